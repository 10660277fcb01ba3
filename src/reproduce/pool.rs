//! Independent jobs on all cores.

use std::num::NonZero;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Runs `work` on every job, on as many threads as there are cores, and gives the results in the order of the jobs:
/// which thread does what has no influence on them.
///
/// A panic in a job goes on in the caller.
pub fn in_parallel<J: Sync, R: Send>(jobs: &[J], work: impl Fn(&J) -> R + Sync) -> Vec<R> {
    let cores = std::thread::available_parallelism().map_or(1, NonZero::get);
    let next = AtomicUsize::new(0);
    let worker = || {
        let mut done = Vec::new();
        while let Some((index, job)) =
            Some(next.fetch_add(1, Ordering::Relaxed)).and_then(|index| Some((index, jobs.get(index)?)))
        {
            done.push((index, work(job)));
        }
        done
    };
    let mut results: Vec<(usize, R)> = std::thread::scope(|scope| {
        let workers: Vec<_> = (0..cores.min(jobs.len())).map(|_| scope.spawn(worker)).collect();
        let joined = workers.into_iter().map(|worker| worker.join());
        joined.flat_map(|done| done.unwrap_or_else(|panic| std::panic::resume_unwind(panic))).collect()
    });
    results.sort_unstable_by_key(|(index, _)| *index);
    results.into_iter().map(|(_, result)| result).collect()
}

#[cfg(test)]
mod tests {
    use super::in_parallel;

    #[test]
    fn results_come_in_the_order_of_the_jobs() {
        let jobs: Vec<u64> = (0..100).collect();
        let squares = in_parallel(&jobs, |job| {
            // Early jobs take longest.
            (0..(100 - job) * 1000).fold(job * job, |square, step| std::hint::black_box(square + step) - step)
        });
        assert_eq!(squares, jobs.iter().map(|job| job * job).collect::<Vec<_>>());
        assert!(in_parallel(&[] as &[u64], |job| *job).is_empty());
    }

    #[test]
    #[should_panic(expected = "job 3")]
    fn a_panic_is_not_swallowed() {
        in_parallel(&[1, 2, 3], |job| assert!(*job != 3, "job {job}"));
    }
}

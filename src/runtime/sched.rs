//! Real-time scheduling of the control thread. The only module of this layer with `unsafe`: the standard library and our
//! dependencies have no safe call for the scheduling policy.

use std::time::Duration;

/// Asks for SCHED_FIFO at `priority` for the calling thread and locks the memory the process has now: the control thread
/// uses no other, and locking all that is to come would make the recorder fail at the limit.
///
/// What the system refuses comes back as a sentence each: a refusal costs jitter, not correctness.
#[cfg(target_os = "linux")]
pub(super) fn enter_real_time(priority: u8, lock_memory: bool) -> Vec<String> {
    let mut refused = Vec::new();
    if priority > 0
        && let Err(error) = set_fifo(priority)
    {
        refused.push(format!("real-time priority {priority} refused ({error}): ticks may come late"));
    }
    if lock_memory && let Err(error) = rustix::mm::mlockall(rustix::mm::MlockAllFlags::CURRENT) {
        refused.push(format!("locking memory refused ({error}): a page fault may make a tick late"));
    }
    refused
}

/// Other systems: no real-time scheduling.
#[cfg(not(target_os = "linux"))]
pub(super) fn enter_real_time(_priority: u8, _lock_memory: bool) -> Vec<String> {
    vec!["real-time scheduling is only built for Linux: ticks may come late".to_owned()]
}

#[cfg(target_os = "linux")]
#[allow(unsafe_code)]
fn set_fifo(priority: u8) -> std::io::Result<()> {
    // SAFETY: `sched_param` is plain data for which all zeros is valid.
    let mut parameters: libc::sched_param = unsafe { std::mem::zeroed() };
    parameters.sched_priority = i32::from(priority);
    // SAFETY: the pointer is valid for the duration of the call; 0 names the calling thread.
    let result = unsafe { libc::sched_setscheduler(0, libc::SCHED_FIFO, &raw const parameters) };
    if result == 0 { Ok(()) } else { Err(std::io::Error::last_os_error()) }
}

/// CPU time the calling thread has used.
#[cfg(unix)]
pub(super) fn thread_cpu_time() -> Duration {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    Duration::new(u64::try_from(time.tv_sec).unwrap_or(0), u32::try_from(time.tv_nsec).unwrap_or(0))
}

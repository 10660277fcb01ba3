//! Coverage-guided fuzzing of every decoder and file reader. One program for all targets, because it is the library that
//! takes long to build. `.ci/fuzz` builds and runs it; see `docs/fuzzing.md`.

use std::ffi::{CString, c_char, c_int};
use std::path::Path;
use std::process::ExitCode;
use std::sync::OnceLock;

// Nothing is called by its Rust name: this links libFuzzer.
use libfuzzer_sys as _;

mod can;
mod can_map;
mod damage;
mod files;
mod firmware;
#[allow(dead_code, reason = "what is only for statistics, `tests/it/damage.rs` uses")]
mod frames;
mod input;
mod recording;
mod replay;
mod seeds;
mod serial;
mod slcan;
mod strings;
mod targets;
mod text;

use targets::Target;

const USAGE: &str = "usage: otolith-fuzz list | seeds FOLDER | run TARGET [ARGUMENT OF LIBFUZZER...]";

unsafe extern "C" {
    /// The whole of libFuzzer. It returns when it has found nothing, and ends the process otherwise.
    fn LLVMFuzzerRunDriver(
        count: *mut c_int,
        arguments: *mut *mut *mut c_char,
        take_input: unsafe extern "C" fn(*const u8, usize) -> c_int,
    ) -> c_int;
}

static TARGET: OnceLock<Target> = OnceLock::new();

/// What libFuzzer calls through its own entry point; that of `libfuzzer-sys` wants it to exist.
#[unsafe(no_mangle)]
fn rust_fuzzer_test_input(input: &[u8]) -> c_int {
    if let Some(target) = TARGET.get() {
        (target.run)(input);
    }
    0
}

/// # Safety
/// `data` must point to `size` bytes, or `size` be zero.
unsafe extern "C" fn take_input(data: *const u8, size: usize) -> c_int {
    // SAFETY: libFuzzer keeps its input unchanged during the call; an empty one may come without an address.
    let input = if size == 0 { &[] } else { unsafe { std::slice::from_raw_parts(data, size) } };
    rust_fuzzer_test_input(input)
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match words[1..] {
        ["list"] => {
            targets::all().iter().for_each(|target| println!("{}", target.name));
            ExitCode::SUCCESS
        }
        ["seeds", folder] => match write_seeds(Path::new(folder)) {
            Ok(()) => ExitCode::SUCCESS,
            Err(error) => {
                eprintln!("{folder}: {error}");
                ExitCode::FAILURE
            }
        },
        ["run", name, ..] => match targets::all().into_iter().find(|target| target.name == name) {
            Some(target) => run(target, words[..1].iter().chain(&words[3..])),
            None => {
                eprintln!("no target `{name}`\n{USAGE}");
                ExitCode::from(2)
            }
        },
        _ => {
            eprintln!("{USAGE}");
            ExitCode::from(2)
        }
    }
}

/// One folder of inputs for each target.
fn write_seeds(folder: &Path) -> std::io::Result<()> {
    for target in targets::all() {
        let folder = folder.join(&target.name);
        std::fs::create_dir_all(&folder)?;
        for (number, seed) in (target.seeds)().iter().enumerate() {
            std::fs::write(folder.join(format!("seed-{number:04}")), seed)?;
        }
    }
    Ok(())
}

fn run<'a>(target: Target, arguments: impl Iterator<Item = &'a &'a str>) -> ExitCode {
    TARGET.get_or_init(|| target);
    // A panic is a finding: end here, where libFuzzer saves the input.
    let say = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        say(panic);
        std::process::abort();
    }));
    let arguments = arguments.filter_map(|argument| CString::new(*argument).ok()).map(CString::into_raw);
    let mut arguments: Vec<*mut c_char> = arguments.collect();
    let mut count = arguments.len() as c_int;
    arguments.push(std::ptr::null_mut());
    let mut arguments = arguments.as_mut_ptr();
    // SAFETY: a list of `count` texts with a null behind it, all of which live as long as the process, as `main` has it.
    match unsafe { LLVMFuzzerRunDriver(&raw mut count, &raw mut arguments, take_input) } {
        0 => ExitCode::SUCCESS,
        _ => ExitCode::FAILURE,
    }
}

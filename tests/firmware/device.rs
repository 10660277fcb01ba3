//! The simulated device: what is built for it, and its life.

use std::io::{Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::OnceLock;

use rustix::process::{Pid, Signal, kill_process};

use crate::{MOST_POLLS, POLL};

/// What must be built to run the firmware.
pub(crate) struct Bench {
    pub(crate) simhost: PathBuf,
    pub(crate) synthetic: PathBuf,
    pub(crate) mpu6050: PathBuf,
    /// The same at 1 MBd and 1 kHz.
    pub(crate) fast_mpu6050: PathBuf,
}

/// `None` when the tools are not here and need not be.
pub(crate) fn bench() -> Option<&'static Bench> {
    static BENCH: OnceLock<Option<Bench>> = OnceLock::new();
    BENCH
        .get_or_init(|| {
            let missing = missing_tools();
            if missing.is_empty() {
                return Some(Bench::build());
            }
            assert!(std::env::var_os("CI").is_none(), "missing: {missing:?}");
            // Past the harness, which shows the output of failed tests only.
            let _ = writeln!(
                std::io::stderr(),
                "skipped: simulated firmware: not installed: {} (Debian: make gcc-avr avr-libc libsimavr-dev)",
                missing.join(", ")
            );
            None
        })
        .as_ref()
}

fn missing_tools() -> Vec<&'static str> {
    let preprocesses = |compiler: &str, header: &str| {
        let mut child = Command::new(compiler)
            .args(["-E", "-x", "c", "-"])
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .ok()?;
        child.stdin.take()?.write_all(format!("#include <{header}>\n").as_bytes()).ok()?;
        child.wait().ok()?.success().then_some(())
    };
    let mut missing = Vec::new();
    if Command::new("make").arg("--version").output().is_err() {
        missing.push("make");
    }
    for (compiler, header, name) in [
        ("cc", "simavr/sim_avr.h", "libsimavr with its headers"),
        ("avr-gcc", "avr/io.h", "avr-gcc with avr-libc"),
    ] {
        if preprocesses(compiler, header).is_none() {
            missing.push(name);
        }
    }
    missing
}

impl Bench {
    fn build() -> Self {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("firmware");
        let make = |example: &str, name: &str, settings: &[&str]| {
            let output = Command::new("make")
                .arg("-C")
                .arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("firmware-protocol/examples").join(example))
                .arg(format!("BUILD={}", folder.join(name).display()))
                .args(settings)
                .output()
                .unwrap();
            assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
            folder.join(name)
        };
        Self {
            simhost: make("simhost", "simhost", &[]).join("simhost"),
            synthetic: make("avr-mpu6050", "synthetic", &["SYNTHETIC=1"]).join("firmware.elf"),
            mpu6050: make("avr-mpu6050", "mpu6050", &[]).join("firmware.elf"),
            fast_mpu6050: make("avr-mpu6050", "fast-mpu6050", &["BAUD=1000000", "RATE_HZ=1000"])
                .join("firmware.elf"),
        }
    }
}

/// A firmware that runs and is plugged in. It starts anew whenever its port is opened, as an Arduino does.
pub(crate) struct Device {
    simhost: Child,
    pub(crate) port: PathBuf,
}

impl Device {
    pub(crate) fn plug_in(bench: &Bench, folder: &Path, firmware: &Path, options: &[&str]) -> Self {
        let port = folder.join("ttyIMU");
        let simhost = Command::new(&bench.simhost)
            .arg("--reset-on-open")
            .args(options)
            .args([firmware, &port])
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut device = Self { simhost, port };
        for _ in 0..MOST_POLLS {
            if device.port.exists() {
                return device;
            }
            assert!(device.simhost.try_wait().unwrap().is_none(), "{}", device.last_words());
            wait();
        }
        panic!("no port");
    }

    fn last_words(&mut self) -> String {
        let mut text = String::new();
        self.simhost.stderr.take().unwrap().read_to_string(&mut text).unwrap();
        text
    }

    /// Ends it as a user would, and gives what it said.
    pub(crate) fn unplug(mut self) -> String {
        kill_process(Pid::from_child(&self.simhost), Signal::TERM).unwrap();
        let said = self.last_words();
        println!("{said}");
        assert_eq!(self.simhost.wait().unwrap().code(), Some(0), "{said}");
        assert!(std::fs::symlink_metadata(&self.port).is_err(), "the link must go with the device");
        said
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        let _gone_already = self.simhost.kill();
        let _status = self.simhost.wait();
    }
}

#[allow(clippy::disallowed_methods, reason = "the device lives by the clock")]
fn wait() {
    std::thread::sleep(POLL);
}

//! `otolith calibrate` on a live device, as a person makes it: the device moves as the program asks.

use std::io::{BufRead as _, BufReader, Read as _};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::time::{Duration, Instant};

use serde_json::Value;

use super::{Firmware, ONE_AT_A_TIME, STANDARD_GRAVITY, Sample, number, otolith, summary};
use crate::port::Port;

const RATE_HZ: f64 = 200.0;
/// Reading over truth.
const GYRO_GAIN: f64 = 1.02;
const GYRO_BIAS: [f64; 3] = [0.01, -0.02, 0.005];
/// Two turns to the left.
const SPIN_RATE: f64 = 1.5;
const SPIN_RAMP_S: f64 = 1.0;
const TURNED: f64 = 2.0 * std::f64::consts::TAU;
/// Ends hangs; never decides a test.
const PATIENCE: Duration = Duration::from_secs(180);

/// The sensor lies upside down, its x to the left: its axes in head axes.
fn to_imu([x, y, z]: [f64; 3]) -> [f64; 3] {
    [y, x, -z]
}

/// A motion, told in head axes.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Act {
    Rest,
    Nod,
    Shake,
    Spin,
}

impl Act {
    /// What a person does who is told this.
    fn asked_for(line: &str) -> Option<Self> {
        let acts = [("nod:", Self::Nod), ("shake:", Self::Shake), ("spin:", Self::Spin)];
        acts.into_iter().find(|(word, _)| line.contains(&format!(": {word}"))).map(|(_, act)| act)
    }

    fn duration_s(self) -> f64 {
        match self {
            Self::Rest => f64::INFINITY,
            Self::Nod | Self::Shake => 4.5,
            Self::Spin => TURNED / SPIN_RATE + SPIN_RAMP_S,
        }
    }

    /// Rate and specific force, head axes.
    fn motion(self, s: f64) -> ([f64; 3], [f64; 3]) {
        let upright = [0.0, 0.0, STANDARD_GRAVITY];
        // Three times there and back: angle and its rate.
        let (amplitude, pace) = (30.0_f64.to_radians(), std::f64::consts::TAU / 1.5);
        let angle = 0.5 * amplitude * (1.0 - (pace * s).cos());
        let rate = 0.5 * amplitude * pace * (pace * s).sin();
        match self {
            Self::Rest => ([0.0; 3], upright),
            Self::Nod => {
                ([0.0, rate, 0.0], [-angle.sin() * STANDARD_GRAVITY, 0.0, angle.cos() * STANDARD_GRAVITY])
            }
            Self::Shake => ([0.0, 0.0, rate], upright),
            Self::Spin => {
                let rise = (s / SPIN_RAMP_S).clamp(0.0, 1.0);
                let fall = ((self.duration_s() - s) / SPIN_RAMP_S).clamp(0.0, 1.0);
                ([0.0, 0.0, SPIN_RATE * rise.min(fall)], upright)
            }
        }
    }
}

/// What the device reads of a motion.
fn reading(t_s: f64, (omega, force): ([f64; 3], [f64; 3])) -> Sample {
    let omega = to_imu(omega.map(|rate| GYRO_GAIN * rate));
    Sample { t_s, omega: std::array::from_fn(|i| omega[i] + GYRO_BIAS[i]), force: to_imu(force) }
}

/// The program, and what it has said so far.
struct Program {
    child: Child,
    lines: Receiver<String>,
    said: Vec<String>,
}

impl Drop for Program {
    /// A test that failed leaves nobody behind.
    fn drop(&mut self) {
        let _ended = self.child.kill();
        let _code = self.child.wait();
    }
}

impl Program {
    fn start(arguments: &[&str]) -> Self {
        let mut child = Command::new(env!("CARGO_BIN_EXE_otolith"))
            .args(arguments)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let (sender, lines) = channel();
        let stderr = BufReader::new(child.stderr.take().unwrap());
        std::thread::spawn(move || {
            for line in stderr.lines().map_while(Result::ok) {
                let _gone = sender.send(line);
            }
        });
        Self { child, lines, said: Vec::new() }
    }

    /// The next line that was said, if there is one; `Err` once the program has ended.
    fn next_line(&mut self) -> Result<Option<String>, TryRecvError> {
        match self.lines.try_recv() {
            Ok(line) => {
                self.said.push(line.clone());
                Ok(Some(line))
            }
            Err(TryRecvError::Empty) => Ok(None),
            Err(gone) => Err(gone),
        }
    }

    fn interrupt(&self) {
        let pid = rustix::process::Pid::from_child(&self.child);
        rustix::process::kill_process(pid, rustix::process::Signal::INT).unwrap();
    }

    /// Exit code and stdout.
    fn end(mut self) -> (Option<i32>, String, Vec<String>) {
        let mut stdout = String::new();
        self.child.stdout.take().unwrap().read_to_string(&mut stdout).unwrap();
        let code = self.child.wait().unwrap().code();
        self.said.extend(self.lines.iter());
        (code, stdout, std::mem::take(&mut self.said))
    }
}

/// What goes wrong on the way.
#[derive(Clone, Copy, PartialEq)]
enum Mishap {
    None,
    /// Ctrl-C in the middle of the nod.
    Interrupt,
    /// The device goes away in the middle of the first nod and comes back after 2.5 s with its clock at zero.
    Unplug,
}

/// Plays the device until the program ends; it does what the program asks for. Gives what it was made to do.
fn play(program: &mut Program, port: Port, link: &Path, mishap: Mishap) -> Vec<Act> {
    let mut port = Some(port);
    let mut firmware = Firmware::new(RATE_HZ);
    let (start, mut clock_start) = (Instant::now(), Instant::now());
    let (mut act, mut act_start) = (Act::Rest, start);
    let (mut done, mut mishap) = (Vec::new(), mishap);
    let mut back_at: Option<Instant> = None;
    for index in 0_u32.. {
        let due = Duration::from_secs_f64(f64::from(index) / RATE_HZ);
        std::thread::sleep(due.saturating_sub(start.elapsed()));
        assert!(start.elapsed() < PATIENCE, "{:?}", program.said);
        match program.next_line() {
            Ok(Some(line)) => {
                if let Some(asked) = Act::asked_for(&line) {
                    // Nobody moves at once.
                    (act, act_start) = (asked, Instant::now() + Duration::from_millis(500));
                    done.push(asked);
                }
            }
            Ok(None) => {}
            Err(_) => break,
        }
        let act_s = Instant::now().saturating_duration_since(act_start).as_secs_f64();
        if act_s > act.duration_s() {
            act = Act::Rest;
        }
        if act == Act::Nod && act_s > 2.0 {
            match std::mem::replace(&mut mishap, Mishap::None) {
                Mishap::Interrupt => program.interrupt(),
                Mishap::Unplug => {
                    std::fs::remove_file(link).unwrap();
                    (port, act) = (None, Act::Rest);
                    back_at = Some(Instant::now() + Duration::from_millis(2500));
                }
                Mishap::None => {}
            }
        }
        if back_at.is_some_and(|at| Instant::now() >= at) {
            (port, back_at, clock_start) = (Some(Port::plug_in(link)), None, Instant::now());
            firmware = Firmware::new(RATE_HZ);
        }
        let started = Instant::now() >= act_start;
        let motion = if started { act.motion(act_s) } else { Act::Rest.motion(0.0) };
        let sample = reading(clock_start.elapsed().as_secs_f64(), motion);
        if let Some(port) = &port {
            port.write(&firmware.frames(&sample));
        }
    }
    done
}

/// What became of a calibration.
struct Outcome {
    code: Option<i32>,
    stdout: String,
    said: Vec<String>,
    acts: Vec<Act>,
    out: PathBuf,
}

impl Outcome {
    /// Calibrates a device that does what it is told.
    fn of(folder: &Path, more: &[&str], mishap: Mishap) -> Self {
        let (link, out) = (folder.join("ttyIMU"), folder.join("out"));
        let port = Port::plug_in(&link);
        let device = format!("serial:{}", link.display());
        let arguments = ["calibrate", "--device", &device, "--out", out.to_str().unwrap(), "--json"];
        let mut program = Program::start(&[&arguments[..], more].concat());
        let acts = play(&mut program, port, &link, mishap);
        let (code, stdout, said) = program.end();
        Self { code, stdout, said, acts, out }
    }

    fn json(&self) -> Value {
        serde_json::from_str(&self.stdout).unwrap_or_else(|error| panic!("{error}: {:?}", self.said))
    }

    fn says(&self, part: &str) -> bool {
        self.said.iter().any(|line| line.contains(part))
    }

    fn files(&self) -> Vec<String> {
        let entries = std::fs::read_dir(&self.out).unwrap();
        let mut names: Vec<String> =
            entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }
}

/// The mount is that of the device.
fn mount_is_right(json: &Value) {
    for (row, expected) in [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]].into_iter().enumerate() {
        for (column, expected) in expected.into_iter().enumerate() {
            let found = number(json, &format!("/mount/matrix/{row}/{column}"));
            assert!((found - expected).abs() < 0.01, "{}", json["mount"]);
        }
    }
}

#[test]
fn a_guided_calibration_gives_files_that_a_run_takes() {
    let _alone = ONE_AT_A_TIME.lock();
    let folder = tempfile::tempdir().unwrap();
    let guided = Outcome::of(folder.path(), &["--up", "shake", "--turned-deg", "720"], Mishap::None);
    assert_eq!(guided.code, Some(0), "{:?}", guided.said);
    assert_eq!(guided.acts, [Act::Nod, Act::Shake, Act::Spin]);
    assert!(guided.said[0].contains("keep the sensor still for 3 s (Ctrl-C ends"), "{:?}", guided.said);
    assert!(guided.says("all motions were recognised"), "{:?}", guided.said);
    let json = guided.json();
    mount_is_right(&json);
    let scale = number(&json, "/gyro_scale/scale/value");
    assert!((scale * GYRO_GAIN - 1.0).abs() < 0.005, "{scale}");
    for (axis, bias) in GYRO_BIAS.into_iter().enumerate() {
        assert!((number(&json, &format!("/gyro_bias_rad_s/value/{axis}")) - bias).abs() < 1e-3, "{json}");
    }
    assert_eq!(guided.files(), ["calibration.json", "calibration.toml", "mount.toml"]);

    // The same device, two turns once more.
    let spin = |s: f64| if s < 2.0 { Act::Rest.motion(0.0) } else { Act::Spin.motion(s - 2.0) };
    let samples: Vec<Sample> = (0..(14.0 * RATE_HZ) as u32)
        .map(|index| f64::from(index) / RATE_HZ)
        .map(|t_s| Sample { t_s, ..reading(t_s, spin(t_s)) })
        .collect();
    let link = folder.path().join("ttyIMU");
    let port = Port::plug_in(&link);
    let device = format!("serial:{}", link.display());
    let files = ["mount.toml", "calibration.toml"].map(|name| guided.out.join(name).display().to_string());
    let arguments = ["run", "--device", &device, "--mount", &files[0], "--calibration", &files[1]];
    let output = std::thread::scope(|scope| {
        let program = scope.spawn(|| otolith(&[&arguments[..], &["--duration-s", "15", "--json"]].concat()));
        std::thread::sleep(Duration::from_millis(300));
        super::play(&link, Some(port), &samples, RATE_HZ, super::Mischief::default());
        program.join().unwrap()
    });
    let run = summary(&output);
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let turned = number(&run, "/chair/turned_deg");
    assert!((turned / 720.0 - 1.0).abs() < 0.01, "{turned}");
    assert!(number(&run, "/alignment/mount_tilt_deg") < 1.0, "{}", run["alignment"]);
    assert_eq!(run["alignment"]["heading_arbitrary"], false);
}

#[test]
fn ctrl_c_in_the_middle_leaves_what_is_known_and_nothing_half_done() {
    let _alone = ONE_AT_A_TIME.lock();
    let folder = tempfile::tempdir().unwrap();
    let ended = Outcome::of(folder.path(), &["--turned-deg", "720"], Mishap::Interrupt);
    assert_eq!(ended.code, Some(1), "{:?}", ended.said);
    assert!(
        ended.says("not determined; mount.toml was not written") && ended.says("hint: "),
        "{:?}",
        ended.said
    );
    assert_eq!(ended.files(), ["calibration.json", "calibration.toml"]);
    let json = ended.json();
    assert_eq!(json["mount"], Value::Null);
    assert_eq!(json["gyro_scale"], Value::Null);
    // What was written is whole.
    let calibration = ended.out.join("calibration.toml").display().to_string();
    let mock =
        ["run", "--device", "mock:rest?rest_s=2", "--pace", "max", "--calibration", &calibration, "--json"];
    assert_eq!(otolith(&mock).status.code(), Some(0));
}

#[test]
fn an_unplugged_device_is_waited_for_and_the_motion_asked_for_again() {
    let _alone = ONE_AT_A_TIME.lock();
    let folder = tempfile::tempdir().unwrap();
    let mended = Outcome::of(folder.path(), &[], Mishap::Unplug);
    assert_eq!(mended.code, Some(0), "{:?}", mended.said);
    assert_eq!(mended.acts, [Act::Nod, Act::Nod, Act::Spin], "{:?}", mended.said);
    for part in ["connection lost, waiting", "connection is back", "not recognised"] {
        assert!(mended.says(part), "{part} is missing in {:?}", mended.said);
    }
    let json = mended.json();
    mount_is_right(&json);
    assert!(json["notes"].to_string().contains("connection was lost"), "{}", json["notes"]);
}

#[test]
fn a_device_that_says_nothing_ends_with_its_time() {
    let _alone = ONE_AT_A_TIME.lock();
    let folder = tempfile::tempdir().unwrap();
    let link = folder.path().join("ttyIMU");
    let _port = Port::plug_in(&link);
    let device = format!("serial:{}", link.display());
    let program = Program::start(&["calibrate", "--device", &device, "--duration-s", "5", "--json"]);
    let (code, stdout, said) = program.end();
    assert_eq!((code, stdout.as_str()), (Some(1), ""), "{said:?}");
    for part in ["not one sample for 3 s", "otolith doctor", "not one sample was found"] {
        assert!(said.iter().any(|line| line.contains(part)), "{part} is missing in {said:?}");
    }
}

//! The string that names a device: `scheme:target?key=value&key=value`.

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

use super::DeviceError;
use super::mock::MockParams;
use super::replay::FileKind;
use super::slcan;

/// Baud rate of a `serial:` selector without `baud`, and of raw captures without a device's clock: our protocol's 1 kHz needs it.
pub const DEFAULT_BAUD: u32 = 921_600;
/// Baud rates accepted: from the slowest modem to the fastest USB bridge in use.
const BAUD_RANGE: std::ops::RangeInclusive<u32> = 300..=12_000_000;
/// Highest node number whose seven identifiers still fit in 11 bits: 0x3A0 + 0x10 × 69 + 6 = 0x7F6.
const MAX_NODE: u8 = 69;
/// Largest identifier of 11 bits.
const MAX_STANDARD_ID: u16 = 0x7FF;

/// A device, parsed. `Display` writes a selector that parses to the same value.
///
/// | selector | means |
/// |---|---|
/// | `serial:PORT?baud=921600` | a serial port, 8N1 |
/// | `serial:usb=SERIALNUMBER?baud=921600` | the serial port of the USB device with this serial number |
/// | `can:IFACE?node=N`, `can:IFACE?witmotion_id=0x50` | a SocketCAN interface, and which [`CanDevice`] on the bus |
/// | `slcan:PORT?bitrate=500000&baud=115200&node=N` | a CAN bus behind a serial adapter that speaks slcan; PORT as of `serial:`, device as of `can:` |
/// | `replay:FILE?kind=text\|candump\|raw\|tlog&baud=N` | a recording; the kind is found from the content if not given |
/// | `mock:chair?rate_rpm=30&spin_s=15...`, `mock:rest?rest_s=10...` | no hardware, keys of [`MockParams`] |
#[derive(Clone, Debug, PartialEq)]
pub enum Selector {
    /// A serial port, 8N1.
    Serial {
        /// Path or name of the port, or `usb=` and the serial number of its USB device.
        port: String,
        /// Baud rate, bit/s.
        baud: u32,
    },
    /// A SocketCAN interface.
    Can {
        /// Name of the network interface.
        interface: String,
        /// Which device on the bus is meant.
        device: CanDevice,
    },
    /// A CAN bus behind a serial adapter that speaks slcan.
    Slcan {
        /// Path or name of the adapter's port, or `usb=` and the serial number of its USB device.
        port: String,
        /// Bitrate of the bus, bit/s: one of [`slcan::codec::BITRATES`].
        bitrate: u32,
        /// Baud rate of the port, bit/s.
        baud: u32,
        /// Which device on the bus is meant.
        device: CanDevice,
    },
    /// A recorded file.
    Replay {
        /// The file.
        path: PathBuf,
        /// What the file holds; `None` to find out from its content.
        kind: Option<FileKind>,
        /// Baud rate a raw capture was taken at, bit/s: its time, where the device tells none.
        baud: u32,
    },
    /// A simulated device.
    Mock(MockParams),
}

/// Which of the devices on a CAN bus is meant.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CanDevice {
    /// The first whose protocol is understood.
    #[default]
    First,
    /// The one with this node number, of our own protocol.
    Node(u8),
    /// The WitMotion device with this identifier, which can be set in it.
    WitMotion(u16),
}

impl CanDevice {
    /// The option that names it, `None` for the first.
    fn option(self) -> Option<String> {
        match self {
            CanDevice::First => None,
            CanDevice::Node(node) => Some(format!("node={node}")),
            CanDevice::WitMotion(id) => Some(format!("witmotion_id={id:#x}")),
        }
    }
}

impl Selector {
    /// Which device on a CAN bus is meant; the first where there is no bus.
    pub fn can_device(&self) -> CanDevice {
        match self {
            Selector::Can { device, .. } | Selector::Slcan { device, .. } => *device,
            _ => CanDevice::First,
        }
    }
}

impl FromStr for Selector {
    type Err = DeviceError;

    fn from_str(text: &str) -> Result<Self, DeviceError> {
        let (scheme, rest) = text.split_once(':').ok_or_else(|| {
            let hint = if text.contains("tty") || text.starts_with("COM") {
                format!("write `serial:{text}`")
            } else {
                SCHEMES_HINT.to_owned()
            };
            problem(text, "no scheme, expected `scheme:target`", hint)
        })?;
        // The last `?` starts the options, so a file name may contain one if it has options after it.
        let (target, query) = rest.rsplit_once('?').unwrap_or((rest, ""));
        let options = Options::parse(text, query)?;
        if target.is_empty() {
            return Err(problem(text, "nothing after the scheme", SCHEMES_HINT.to_owned()));
        }
        match scheme {
            "serial" => serial(target, &options),
            "can" => can(target, &options),
            "slcan" => slcan(target, &options),
            "replay" => replay(target, &options),
            "mock" => mock(target, &options),
            other => Err(problem(text, &format!("unknown scheme `{other}`"), SCHEMES_HINT.to_owned())),
        }
    }
}

const SCHEMES_HINT: &str = "known: serial:/dev/ttyUSB0?baud=921600, can:can0, slcan:/dev/ttyACM0?bitrate=500000, replay:FILE, mock:chair, mock:rest (`otolith devices` lists ports)";

/// The `key=value` pairs after the `?`, with the whole selector for error texts.
struct Options<'a> {
    selector: &'a str,
    pairs: Vec<(&'a str, &'a str)>,
}

impl<'a> Options<'a> {
    fn parse(selector: &'a str, query: &'a str) -> Result<Self, DeviceError> {
        let mut pairs: Vec<(&str, &str)> = Vec::new();
        for piece in query.split('&').filter(|piece| !piece.is_empty()) {
            let Some((key, value)) = piece.split_once('=') else {
                let hint = "options are written `?key=value&key=value`".to_owned();
                return Err(problem(selector, &format!("option `{piece}` has no value"), hint));
            };
            if pairs.iter().any(|(seen, _)| *seen == key) {
                return Err(problem(selector, &format!("option `{key}` given twice"), "keep one".to_owned()));
            }
            pairs.push((key, value));
        }
        Ok(Self { selector, pairs })
    }

    fn allow_only(&self, allowed: &[&str]) -> Result<(), DeviceError> {
        match self.pairs.iter().find(|(key, _)| !allowed.contains(key)) {
            Some((key, _)) => Err(problem(
                self.selector,
                &format!("unknown option `{key}`"),
                format!("known options here: {}", allowed.join(", ")),
            )),
            None => Ok(()),
        }
    }

    fn value(&self, key: &str) -> Option<&'a str> {
        self.pairs.iter().find(|(name, _)| *name == key).map(|(_, value)| *value)
    }

    fn baud(&self, default: u32) -> Result<u32, DeviceError> {
        let Some(text) = self.value("baud") else { return Ok(default) };
        text.parse().ok().filter(|baud| BAUD_RANGE.contains(baud)).ok_or_else(|| {
            let hint = "expected a whole number from 300 to 12000000, such as 115200 or 921600".to_owned();
            problem(self.selector, &format!("baud = `{text}` is not a baud rate"), hint)
        })
    }

    fn bitrate(&self) -> Result<u32, DeviceError> {
        let Some(text) = self.value("bitrate") else { return Ok(slcan::DEFAULT_BITRATE) };
        text.parse().ok().filter(|bitrate| slcan::codec::BITRATES.contains(bitrate)).ok_or_else(|| {
            let hint = format!("slcan knows {} bit/s", slcan::codec::bitrate_list());
            problem(self.selector, &format!("bitrate = `{text}` is no bitrate of slcan"), hint)
        })
    }

    fn can_device(&self) -> Result<CanDevice, DeviceError> {
        match (self.value("node"), self.value("witmotion_id")) {
            (None, None) => Ok(CanDevice::First),
            (Some(text), None) => {
                let node = text.parse().ok().filter(|node| *node <= MAX_NODE);
                node.map(CanDevice::Node).ok_or_else(|| {
                    let hint = format!("expected a whole number from 0 to {MAX_NODE}");
                    problem(self.selector, &format!("node = `{text}` is not a node number"), hint)
                })
            }
            (None, Some(text)) => {
                let digits = text.strip_prefix("0x").map(|digits| u16::from_str_radix(digits, 16));
                let id = digits.unwrap_or_else(|| text.parse()).ok().filter(|id| *id <= MAX_STANDARD_ID);
                id.map(CanDevice::WitMotion).ok_or_else(|| {
                    let hint = format!("expected 0x0 to {MAX_STANDARD_ID:#x}, such as 0x50 or 80");
                    problem(self.selector, &format!("witmotion_id = `{text}` is no identifier"), hint)
                })
            }
            (Some(_), Some(_)) => {
                let hint =
                    "`node` is for devices of our own protocol, `witmotion_id` for WitMotion".to_owned();
                Err(problem(self.selector, "both `node` and `witmotion_id` are given", hint))
            }
        }
    }
}

fn problem(selector: &str, problem: &str, hint: String) -> DeviceError {
    DeviceError::Selector { selector: selector.to_owned(), problem: problem.to_owned(), hint }
}

fn serial(target: &str, options: &Options<'_>) -> Result<Selector, DeviceError> {
    options.allow_only(&["baud"])?;
    Ok(Selector::Serial { port: target.to_owned(), baud: options.baud(DEFAULT_BAUD)? })
}

fn can(target: &str, options: &Options<'_>) -> Result<Selector, DeviceError> {
    options.allow_only(&["node", "witmotion_id"])?;
    Ok(Selector::Can { interface: target.to_owned(), device: options.can_device()? })
}

fn slcan(target: &str, options: &Options<'_>) -> Result<Selector, DeviceError> {
    options.allow_only(&["bitrate", "baud", "node", "witmotion_id"])?;
    Ok(Selector::Slcan {
        port: target.to_owned(),
        bitrate: options.bitrate()?,
        baud: options.baud(slcan::DEFAULT_BAUD)?,
        device: options.can_device()?,
    })
}

fn replay(target: &str, options: &Options<'_>) -> Result<Selector, DeviceError> {
    options.allow_only(&["kind", "baud"])?;
    let kind = match options.value("kind") {
        None => None,
        Some("text") => Some(FileKind::Text),
        Some("candump") => Some(FileKind::Candump),
        Some("raw") => Some(FileKind::Raw),
        Some("tlog") => Some(FileKind::Tlog),
        Some(other) => {
            let hint = "known kinds: text, candump, raw, tlog".to_owned();
            return Err(problem(options.selector, &format!("unknown kind `{other}`"), hint));
        }
    };
    Ok(Selector::Replay { path: PathBuf::from(target), kind, baud: options.baud(DEFAULT_BAUD)? })
}

fn mock(target: &str, options: &Options<'_>) -> Result<Selector, DeviceError> {
    let Some(mut params) = MockParams::named(target) else {
        let hint = "known mocks: mock:chair (rotates and stops), mock:rest (stands still)".to_owned();
        return Err(problem(options.selector, &format!("unknown mock `{target}`"), hint));
    };
    options.allow_only(&MockParams::KEYS)?;
    for (key, value) in &options.pairs {
        params.set(key, value).map_err(|expected| {
            problem(options.selector, &format!("{key} = `{value}`"), format!("expected {expected}"))
        })?;
    }
    params.validate()?;
    Ok(Selector::Mock(params))
}

impl fmt::Display for Selector {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Selector::Serial { port, baud } => write!(f, "serial:{port}?baud={baud}"),
            Selector::Can { interface, device } => match device.option() {
                Some(option) => write!(f, "can:{interface}?{option}"),
                // Where options follow, if only none, a `?` in the name stays part of it.
                None if interface.contains('?') => write!(f, "can:{interface}?"),
                None => write!(f, "can:{interface}"),
            },
            Selector::Slcan { port, bitrate, baud, device } => {
                write!(f, "slcan:{port}?bitrate={bitrate}&baud={baud}")?;
                device.option().map_or(Ok(()), |option| write!(f, "&{option}"))
            }
            Selector::Replay { path, kind, baud } => {
                // The options are always written, so that a `?` in the file name stays part of it.
                write!(f, "replay:{}?", path.display())?;
                if let Some(kind) = kind {
                    write!(f, "kind={kind}&")?;
                }
                write!(f, "baud={baud}")
            }
            Selector::Mock(params) => write!(f, "mock:{params}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn parse(text: &str) -> Selector {
        text.parse().unwrap_or_else(|error| panic!("{text}: {error}"))
    }

    #[test]
    fn the_documented_selectors_parse() {
        assert_eq!(
            parse("serial:/dev/ttyUSB0?baud=115200"),
            Selector::Serial { port: "/dev/ttyUSB0".into(), baud: 115_200 }
        );
        assert_eq!(parse("serial:COM3"), Selector::Serial { port: "COM3".into(), baud: DEFAULT_BAUD });
        assert_eq!(
            parse("serial:usb=FT4X7A?baud=115200"),
            Selector::Serial { port: "usb=FT4X7A".into(), baud: 115_200 }
        );
        assert_eq!(parse("can:can0"), Selector::Can { interface: "can0".into(), device: CanDevice::First });
        for (text, device) in [
            ("node=2", CanDevice::Node(2)),
            ("witmotion_id=0x50", CanDevice::WitMotion(0x50)),
            ("witmotion_id=80", CanDevice::WitMotion(80)),
        ] {
            let selector = parse(&format!("can:can0?{text}"));
            assert_eq!(selector, Selector::Can { interface: "can0".into(), device });
        }
        assert_eq!(
            parse("slcan:/dev/ttyACM0?bitrate=250000&baud=1000000&node=3"),
            Selector::Slcan {
                port: "/dev/ttyACM0".into(),
                bitrate: 250_000,
                baud: 1_000_000,
                device: CanDevice::Node(3)
            }
        );
        assert_eq!(
            parse("slcan:COM4"),
            Selector::Slcan {
                port: "COM4".into(),
                bitrate: 500_000,
                baud: 115_200,
                device: CanDevice::First
            }
        );
        assert_eq!(
            parse("replay:../logs/a:b.txt"),
            Selector::Replay { path: "../logs/a:b.txt".into(), kind: None, baud: DEFAULT_BAUD }
        );
        let Selector::Mock(params) = parse("mock:chair?rate_rpm=20&spin_s=12.5&noise=0") else {
            panic!("a mock selector");
        };
        assert_eq!((params.rate_rpm, params.spin_s, params.noise), (20.0, 12.5, false));
    }

    #[test]
    fn wrong_selectors_say_what_is_expected() {
        for (text, expected) in [
            ("/dev/ttyUSB0", "write `serial:/dev/ttyUSB0`"),
            ("usb:0", "unknown scheme `usb`"),
            ("serial:", "nothing after the scheme"),
            ("serial:/dev/ttyUSB0?speed=9600", "known options here: baud"),
            ("serial:/dev/ttyUSB0?baud=fast", "baud = `fast`"),
            ("serial:/dev/ttyUSB0?baud=9600&baud=1200", "given twice"),
            ("serial:/dev/ttyUSB0?9600", "has no value"),
            ("can:can0?node=70", "from 0 to 69"),
            ("can:can0?witmotion_id=0x800", "expected 0x0 to 0x7ff"),
            ("can:can0?witmotion_id=50h", "witmotion_id = `50h`"),
            ("can:can0?node=1&witmotion_id=80", "both `node` and `witmotion_id`"),
            ("replay:a.bin?kind=pcap", "known kinds: text, candump, raw, tlog"),
            ("mock:table", "known mocks"),
            ("mock:chair?rpm=3", "rate_rpm"),
            ("mock:chair?spin_s=-1", "spin_s"),
            ("slcan:/dev/ttyACM0?bitrate=1000", "slcan knows 10000, 20000"),
            ("slcan:/dev/ttyACM0?bitrate=S6", "bitrate = `S6`"),
            ("slcan:/dev/ttyACM0?baud=9", "not a baud rate"),
            ("slcan:/dev/ttyACM0?node=70", "0 to 69"),
            ("slcan:/dev/ttyACM0?rate=1", "known options here: bitrate, baud, node, witmotion_id"),
            ("slcan:", "nothing after the scheme"),
            ("mock:chair?spin_s=NaN", "spin_s"),
            ("mock:chair?noise=maybe", "expected 0 or 1"),
        ] {
            let message = text.parse::<Selector>().expect_err(text).to_string();
            assert!(message.contains(expected) && message.contains("\n\nhint: "), "{text}: {message}");
        }
    }

    #[test]
    fn a_question_mark_in_a_name_stays_part_of_it() {
        let can = parse("can:a?b=c?");
        assert_eq!(can, Selector::Can { interface: "a?b=c".into(), device: CanDevice::First });
        assert_eq!(parse(&can.to_string()), can);
    }

    proptest! {
        #[test]
        fn display_parses_to_the_same_selector(
            port in "[a-zA-Z0-9/_.?:-]{1,20}", baud in 300u32..12_000_000,
            device in prop_oneof![
                Just(CanDevice::First),
                (0u8..=69).prop_map(CanDevice::Node),
                (0u16..=0x7FF).prop_map(CanDevice::WitMotion),
            ],
            bitrate in proptest::sample::select(&slcan::codec::BITRATES[..]),
            rate_rpm in -80.0..80.0f64, seed: u64, noise: bool,
        ) {
            let mock = MockParams { rate_rpm, seed, noise, ..MockParams::chair() };
            for selector in [
                Selector::Serial { port: port.clone(), baud },
                Selector::Can { interface: port.clone(), device },
                Selector::Slcan { port: port.clone(), bitrate, baud, device },
                Selector::Replay { path: port.clone().into(), kind: Some(FileKind::Raw), baud },
                Selector::Replay { path: port.into(), kind: None, baud },
                Selector::Mock(mock),
            ] {
                prop_assert_eq!(parse(&selector.to_string()), selector);
            }
        }

        #[test]
        fn any_text_is_parsed_or_refused(text in ".{0,60}") {
            let _ = text.parse::<Selector>();
        }
    }
}

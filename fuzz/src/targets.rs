//! The list of targets. Protocols come from the program's own table, so that a new decoder is fuzzed without a line here.

use otolith::device::protocol::detect::{Bus, PROTOCOLS, decoder_by_name};

use crate::{can, can_map, damage, files, firmware, recording, replay, seeds, serial, slcan, strings, text};

type Run = Box<dyn Fn(&[u8]) + Send + Sync>;

/// Something that takes any bytes.
pub(crate) struct Target {
    pub(crate) name: String,
    pub(crate) run: Run,
    /// Inputs to start from.
    pub(crate) seeds: fn() -> Vec<Vec<u8>>,
}

fn target(
    name: impl Into<String>,
    run: impl Fn(&[u8]) + Send + Sync + 'static,
    seeds: fn() -> Vec<Vec<u8>>,
) -> Target {
    Target { name: name.into(), run: Box::new(run), seeds }
}

/// Every target there is.
pub(crate) fn all() -> Vec<Target> {
    let mut targets: Vec<Target> = PROTOCOLS
        .iter()
        .filter(|protocol| decoder_by_name(protocol.name).is_ok())
        .map(|protocol| match protocol.bus {
            Bus::Serial => target(protocol.name, |data| serial::run(protocol.name, data), seeds::streams),
            Bus::Can => target(protocol.name, |data| can::run(protocol.name, data), seeds::can_frames),
        })
        .collect();
    targets.extend([
        target("recognise-serial", serial::recognise, seeds::streams),
        target("recognise-can", can::recognise, seeds::can_frames),
        target("can-map", can_map::run, can_map::seeds),
        target("can-map-files", can_map::files, can_map::file_seeds),
        target("slcan", slcan::run, slcan::seeds),
        target("damage", damage::run, damage::seeds),
        target("text", text::run, seeds::logs_with_mappings),
        target("text-mapping", text::mapping, || seeds::texts_in("configs/logs")),
        target("replay-text", replay::text, seeds::logs),
        target("replay-candump", replay::candump, seeds::candump_logs),
        target("replay-tlog", replay::tlog, seeds::streams),
        target("replay-raw", replay::raw, seeds::streams),
        target("recording", recording::run, recording::seeds),
        target("config", files::config, seeds::configs),
        target("calibration", files::calibration, files::calibrations),
        target("mount", files::mount, || seeds::texts_in("configs/mounts")),
        target("observer", files::observer, || seeds::texts_in("configs/observers")),
        target("motion", files::motion, || seeds::texts_in("configs/motions")),
        target("character", files::character, || seeds::texts_in("configs/characters")),
        target("selector", strings::selector, strings::selectors),
        target("configure-request", strings::request, strings::requests),
        target("configure-answer", strings::answer, seeds::streams),
        target("firmware-stream", firmware::stream, seeds::streams),
        target("firmware-can", firmware::can, seeds::can_frames),
        target("firmware-payload", firmware::payload, seeds::streams),
    ]);
    targets
}

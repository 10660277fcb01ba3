//! What stands on the command line, and what a device answers to commands.

use std::sync::OnceLock;

use otolith::device::Selector;
use otolith::device::configure::{Answer, Plan, Request, is_configurable};
use otolith::device::protocol::detect::PROTOCOLS;

/// A selector that is accepted is written as one that reads the same.
pub(crate) fn selector(data: &[u8]) {
    let Ok(selector) = std::str::from_utf8(data).unwrap_or_default().parse::<Selector>() else { return };
    let written = selector.to_string();
    let read: Selector = written.parse().unwrap_or_else(|error| panic!("{written}: {error}"));
    assert_eq!(read.to_string(), written);
}

pub(crate) fn selectors() -> Vec<Vec<u8>> {
    let texts = [
        "serial:/dev/ttyUSB0?baud=115200",
        "can:can0?node=2",
        "replay:a?b.txt?kind=candump&baud=9600",
        "replay:log.csv?kind=text",
        "mock:chair?rate_rpm=20&spin_s=12.5&noise=0&seed=7&tilt_deg=-3&latency_s=0.1&sample_rate_hz=200",
        "mock:rest?rest_s=3&gyro_noise=0.1&specific_force_noise=0.2",
    ];
    texts.map(|text| text.as_bytes().to_vec()).to_vec()
}

/// A request that is accepted is met by every protocol or refused, and a plan that is made can be carried out.
pub(crate) fn request(data: &[u8]) {
    let Ok(request) = std::str::from_utf8(data).unwrap_or_default().parse::<Request>() else { return };
    for protocol in PROTOCOLS {
        let Ok(plan) = Plan::new(protocol.name, &request, 921_600) else { continue };
        assert!(plan.rate_hz > 0.0 && plan.bytes_per_sample > 0.0 && !plan.steps.is_empty());
        assert!(plan.steps.iter().all(|step| !step.bytes.is_empty() && !step.what.is_empty()));
    }
}

pub(crate) fn requests() -> Vec<Vec<u8>> {
    ["rate=200, baud=115200,save", "rate=12.5", "save", "rate=1e2,baud=9600"].map(|text| text.into()).to_vec()
}

type Judge = fn(&[u8]) -> Answer;

/// Every judge of answers in every plan.
fn judges() -> &'static [Judge] {
    static JUDGES: OnceLock<Vec<Judge>> = OnceLock::new();
    JUDGES.get_or_init(|| {
        let names = PROTOCOLS.iter().map(|protocol| protocol.name).filter(|name| is_configurable(name));
        let requests = [(None, false), (None, true), (Some(115_200), true)].map(|(baud, save)| Request {
            rate_hz: Some(100.0),
            baud,
            save,
        });
        let plans = names.flat_map(|name| requests.map(|request| Plan::new(name, &request, 921_600)));
        plans.flatten().flat_map(|plan| plan.steps).filter_map(|step| step.answer).collect()
    })
}

/// Bytes are judged at any time: none may do harm, nothing is no answer, and the same bytes get the same judgement.
pub(crate) fn answer(data: &[u8]) {
    for judge in judges() {
        assert_eq!(judge(&[]), Answer::NotYet);
        for end in [data.len() / 3, data.len()] {
            assert_eq!(judge(&data[..end]), judge(&data[..end]));
        }
    }
}

//! The text of `--configure`.

use std::str::FromStr;

use super::{ConfigureError, Request};

impl FromStr for Request {
    type Err = ConfigureError;

    fn from_str(text: &str) -> Result<Self, ConfigureError> {
        let wrong = |problem: String| ConfigureError::Request { text: text.to_owned(), problem };
        let mut request = Self::default();
        for piece in text.split(',').map(str::trim) {
            let (key, value) = piece.split_once('=').unwrap_or((piece, ""));
            let given_twice = match key {
                "rate" => request.rate_hz.is_some(),
                "baud" => request.baud.is_some(),
                "save" => request.save,
                _ => return Err(wrong(format!("unknown key `{key}`, expected rate, baud or save"))),
            };
            if given_twice {
                return Err(wrong(format!("`{key}` is given twice")));
            }
            match key {
                "rate" => {
                    let rate = value.parse().ok().filter(|rate| (0.1..=20_000.0).contains(rate));
                    let expected = || wrong(format!("rate = `{value}`, expected 0.1 to 20000 samples/s"));
                    request.rate_hz = Some(rate.ok_or_else(expected)?);
                }
                "baud" => {
                    let baud = value.parse().ok().filter(|baud| (300..=12_000_000).contains(baud));
                    let expected = || wrong(format!("baud = `{value}`, expected 300 to 12000000 bit/s"));
                    request.baud = Some(baud.ok_or_else(expected)?);
                }
                _ if value.is_empty() => request.save = true,
                _ => return Err(wrong("`save` takes no value".to_owned())),
            }
        }
        Ok(request)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_are_read() {
        let all = Request { rate_hz: Some(200.0), baud: Some(115_200), save: true };
        assert_eq!("rate=200, baud=115200,save".parse::<Request>().expect("a request"), all);
        let rate = Request { rate_hz: Some(12.5), ..Request::default() };
        assert_eq!("rate=12.5".parse::<Request>().expect("a request"), rate);
    }

    #[test]
    fn wrong_requests_say_what_is_expected() {
        for (text, part) in [
            ("", "unknown key ``"),
            ("range=500", "unknown key `range`, expected rate, baud or save"),
            ("rate=fast", "expected 0.1 to 20000 samples/s"),
            ("rate=NaN", "expected 0.1 to 20000 samples/s"),
            ("rate=1,rate=2", "given twice"),
            ("baud=1", "expected 300 to 12000000 bit/s"),
            ("save=1", "takes no value"),
        ] {
            let error = text.parse::<Request>().expect_err(text).to_string();
            assert!(error.contains(part) && error.contains("\n\nhint: "), "{text}: {error}");
        }
    }
}

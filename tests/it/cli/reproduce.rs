//! `otolith reproduce` and the scenarios it is made of.

use serde_json::Value;

use super::{Place, number};

#[test]
fn a_figure_is_reproduced_with_its_claims_its_drawing_and_its_numbers() {
    let place = Place::new();
    let run = place.run(&["reproduce", "--only", "fig10,fig11", "--json", "--out", "out"]).done();
    let json = run.json();
    let claims = json["claims"].as_array().expect("an array");
    let claim = |id: &str| {
        claims.iter().find(|claim| claim["id"] == id).unwrap_or_else(|| panic!("no {id} in {json:#}"))
    };
    for claim in claims {
        for key in ["id", "claim", "paper", "value", "unit", "band", "required", "holds"] {
            assert!(!claim[key].is_null(), "{key} in {claim:#}");
        }
        assert_eq!(claim["band"].as_array().map(Vec::len), Some(2));
    }
    assert_eq!(claim("push_sway_green")["holds"], Value::Bool(true));
    assert!(number(claim("push_sway_green"), "/value") > number(claim("push_sway_blue"), "/value"));
    // The claim that the reference could not reach is listed with what comes out, and does not fail the whole.
    let tilt = claim("push_tilt_green");
    assert_eq!((&tilt["required"], &tilt["holds"]), (&Value::Bool(false), &Value::Bool(false)));
    assert!((0.2..1.0).contains(&number(tilt, "/value")));
    assert_eq!(number(&json, "/parameters/balance/com_stiffness"), 11.0);
    assert!(number(&json, "/simulated_s") > 15.0 && number(&json, "/wall_s") > 0.0);

    for name in ["fig10.svg", "fig11.svg", "fig11.csv", "claims.json"] {
        assert!(place.path("out").join(name).is_file(), "{name}");
    }
    let rows = std::fs::read_to_string(place.path("out").join("fig11.csv")).expect("CSV");
    assert!(rows.starts_with("run,character,time_s,com_sway_deg,"), "{}", &rows[..80]);
    // 16 s at 100 Hz for each of both characters.
    assert!((3150..=3250).contains(&rows.lines().count()), "{}", rows.lines().count());
}

#[test]
fn the_table_names_claim_paper_and_verdict() {
    let place = Place::new();
    let run = place.run(&["reproduce", "--only", "fig11", "--out", "out"]).done();
    let heading = run.stdout.lines().next().expect("a line");
    for word in ["claim", "paper", "otolith", "verdict"] {
        assert!(heading.contains(word), "{heading}");
    }
    assert!(run.stdout.contains("differs, not required"), "{}", run.stdout);
}

#[test]
fn wrong_wishes_are_refused_before_anything_runs() {
    let place = Place::new();
    let unknown = place.run(&["reproduce", "--only", "fig7"]);
    assert_eq!(unknown.code, 2);
    assert!(unknown.stderr.contains("fig9") && unknown.stderr.contains("motions"), "{}", unknown.stderr);
    std::fs::create_dir(place.path("full")).expect("a folder");
    std::fs::write(place.path("full").join("fig11.svg"), "mine").expect("a file");
    place
        .run(&["reproduce", "--only", "fig11", "--out", "full"])
        .refused(2, &["full", "not empty", "--force"]);
    place.run(&["reproduce", "--only", "fig11", "--out", "full/fig11.svg"]).refused(2, &["this is a file"]);
    let both = place.run(&["reproduce", "--sensitivity", "--only", "fig11"]);
    assert_eq!(both.code, 2);
}

#[test]
fn a_scenario_runs_alone_and_takes_flags_on_top() {
    let place = Place::new();
    let json = place.run(&["run", "--scenario", "push-4ns", "--pace", "max", "--json"]).done().json();
    assert!(number(&json, "/green/peak_com_sway_deg") > number(&json, "/blue/peak_com_sway_deg"));
    let text = place.run(&["run", "--scenario", "spin-10rpm-15s", "--spin-s", "3", "--print-config"]).done();
    assert!(text.stdout.contains("spin_s=3") && text.stdout.contains("rate_rpm=10"), "{}", text.stdout);
    let unknown = place.run(&["run", "--scenario", "spin-99rpm"]);
    assert_eq!(unknown.code, 2);
    assert!(unknown.stderr.contains("spin-30rpm-15s"), "{}", unknown.stderr);
}

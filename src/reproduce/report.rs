//! What a reproduction says: every claim with its number, as JSON and as a table.

use std::fmt;

use serde::Serialize;

use super::Claim;
use crate::runtime::CoreSettings;

/// The result of a reproduction.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Every claim and what became of it.
    pub claims: Vec<Claim>,
    /// The one parameter set; scenarios change only what their figure varies.
    pub parameters: CoreSettings,
    /// Time it took, s.
    pub wall_s: f64,
    /// Simulated time it covers, s: each scenario once, green and blue side by side.
    pub simulated_s: f64,
    /// Files that were written.
    pub files: Vec<String>,
}

impl Report {
    /// Whether every required claim holds.
    pub fn holds(&self) -> bool {
        self.claims.iter().all(|claim| claim.holds || !claim.required)
    }
}

impl fmt::Display for Report {
    /// The table, one line a claim, in Markdown with aligned columns, and how long it took.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let heading = ["claim", "paper", "otolith", "verdict"].map(str::to_owned);
        let rows = self
            .claims
            .iter()
            .map(|claim| [claim.claim.to_owned(), claim.paper.to_owned(), found(claim), verdict(claim)]);
        let rows: Vec<[String; 4]> = std::iter::once(heading).chain(rows).collect();
        let widths: [usize; 4] = std::array::from_fn(|column| {
            rows.iter().map(|row| row[column].chars().count()).max().unwrap_or_default()
        });
        for (index, row) in rows.iter().enumerate() {
            write_row(f, row, &widths)?;
            if index == 0 {
                writeln!(f, "|-{}-|", widths.map(|width| "-".repeat(width)).join("-|-"))?;
            }
        }
        let held = self.claims.iter().filter(|claim| claim.holds).count();
        let required = self.claims.iter().filter(|claim| claim.required && !claim.holds).count();
        writeln!(
            f,
            "\n{held} of {} claims hold; of the required ones {required} do not. {:.0} s simulated in {:.1} s: {:.0} x.",
            self.claims.len(),
            self.simulated_s,
            self.wall_s,
            self.simulated_s / self.wall_s.max(1e-9),
        )
    }
}

fn write_row(f: &mut fmt::Formatter<'_>, row: &[String; 4], widths: &[usize; 4]) -> fmt::Result {
    let cells: Vec<String> = row.iter().zip(widths).map(|(cell, &width)| format!("{cell:<width$}")).collect();
    writeln!(f, "| {} |", cells.join(" | "))
}

/// The number with its unit.
fn found(claim: &Claim) -> String {
    let Some(value) = claim.value else { return "none".to_owned() };
    format!("{} {}", short(value), claim.unit).trim_end().to_owned()
}

fn verdict(claim: &Claim) -> String {
    let word = match (claim.holds, claim.required) {
        (true, _) => "holds",
        (false, true) => "DOES NOT HOLD",
        (false, false) => "differs, not required",
    };
    let band = match claim.band {
        [Some(least), Some(largest)] if least == largest => format!(" (exactly {})", short(least)),
        [Some(least), Some(largest)] => format!(" ({} to {})", short(least), short(largest)),
        [Some(least), None] => format!(" (at least {})", short(least)),
        [None, Some(largest)] => format!(" (at most {})", short(largest)),
        [None, None] => String::new(),
    };
    format!("{word}{band}")
}

/// Three decimals below one, two below a hundred, else none.
fn short(value: f64) -> String {
    let decimals = match value.abs() {
        size if size < 1.0 && size != 0.0 => 3,
        size if size < 100.0 && size != 0.0 => 2,
        _ => 0,
    };
    format!("{value:.decimals$}")
}

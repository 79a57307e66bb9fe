//! `noisefloor-lab audience`.

use crate::args::audience::{AudienceArgs, AudienceCommand, FitArgs};
use anyhow::{Context, bail};
use csv::{ReaderBuilder, Trim};
use noisefloor::Audience;
use noisefloor_cli::say::{say, say_json};
use noisefloor_learn::{AudienceFit, MAX_PAIRS};
use serde::Serialize;
use std::path::Path;

/// Columns of the pairs.
const COLUMNS: [&str; 2] = ["observers", "audience"];
/// With fewer pairs the intervals say little.
const FEW_PAIRS: usize = 10;

#[derive(Serialize)]
struct Report {
    #[serde(flatten)]
    fit: AudienceFit,
    /// The line as `render --audience` takes it.
    argument: String,
}

pub fn run(args: AudienceArgs) -> anyhow::Result<()> {
    let AudienceCommand::Fit(FitArgs { file, json }) = args.command;
    let fit = AudienceFit::new(&read(&file)?).with_context(|| file.display().to_string())?;
    let Audience { slope, offset } = fit.line;
    let argument = format!("{slope:.4},{offset:.2}");
    if json {
        return say_json(&Report { fit, argument });
    }
    let sign = if offset < 0.0 { '-' } else { '+' };
    let r = fit.correlation.map_or("undefined".into(), |r| format!("{r:.3}"));
    say!("T' = {slope:.3} T {sign} {:.1}, from {} pairs, r = {r}", offset.abs(), fit.pairs)?;
    let [[a, b], [c, d]] = [fit.slope_interval, fit.offset_interval];
    say!("95 % intervals: slope {a:.3} to {b:.3}, offset {c:.1} to {d:.1}")?;
    if fit.pairs < FEW_PAIRS {
        say!("with fewer than {FEW_PAIRS} pairs the intervals are too narrow: gather more")?;
    }
    say!("use it with: noisefloor render --audience {argument}")?;
    Ok(())
}

/// Reads the pairs (T, T′); other columns are ignored.
fn read(path: &Path) -> anyhow::Result<Vec<(f64, f64)>> {
    let name = path.display();
    let open = || format!("{name}: cannot be read");
    let mut csv =
        ReaderBuilder::new().trim(Trim::All).comment(Some(b'#')).from_path(path).with_context(open)?;
    let header = csv.headers().with_context(open)?;
    let place = |column: &str| {
        header.iter().position(|h| h == column).with_context(|| {
            format!("{name}, line 1: no column {column:?}; the header has to name {}", COLUMNS.join(" and "))
        })
    };
    let places = [place(COLUMNS[0])?, place(COLUMNS[1])?];
    let mut pairs = Vec::new();
    for record in csv.records() {
        let record = record.with_context(|| name.to_string())?;
        let line = record.position().map_or(0, csv::Position::line);
        let number = |i: usize| {
            let text = record.get(places[i]).unwrap_or_default();
            match text.parse::<f64>() {
                Ok(number) if AudienceFit::accepts(number) => Ok(number),
                _ => bail!(
                    "{name}, line {line}: {} is {text:?}, not a number of samples per pixel (10⁻⁶ to 10¹⁵)",
                    COLUMNS[i]
                ),
            }
        };
        pairs.push((number(0)?, number(1)?));
        if pairs.len() > MAX_PAIRS {
            bail!(
                "{name}, line {line}: more than {MAX_PAIRS} pairs; give the mean thresholds of zones, not single answers"
            );
        }
    }
    Ok(pairs)
}

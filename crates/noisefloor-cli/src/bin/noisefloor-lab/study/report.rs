//! What an analysis says, for people.

use noisefloor_cli::say::{NotSaid, say};
use noisefloor_study::analysis::StudyReport;
use noisefloor_study::analysis::tiles::LEAST_OBSERVERS;

/// What of a tile an analysis says, and a rehearsal before it.
pub(super) const COLUMNS: &str = "stack                tile    median      mean  95 % see none";
pub(super) const WHAT_TRAIN_GETS: &str =
    "median, mean and 95 % are over observers, in samples per pixel; `train` gets the mean";

pub(super) fn say_levels(
    stack: &str,
    tile: usize,
    [median, mean, level95]: [f64; 3],
    more: &str,
) -> Result<(), NotSaid> {
    say!("{stack:20} {tile:4} {median:9.0} {mean:9.0} {level95:14.0}{more}")
}

pub(super) fn say_all(report: &StudyReport) -> Result<(), NotSaid> {
    let who = if report.simulated { "simulated observers" } else { "observers" };
    let finished = report.observers.iter().filter(|o| o.finished).count();
    say!("{} {who}, of whom {finished} answered everything", report.observers.len())?;
    for row in &report.observers {
        if let Some(why) = &row.excluded {
            say!("  {} is excluded: {why}", row.code)?;
        }
    }
    say_tiles(report)?;
    if let Some(r) = report.repeats {
        say!(
            "repeats: {} pairs, apart by a factor of {:.2} (median), {:.0} % within one level",
            r.pairs,
            r.factor,
            100.0 * r.within_one_level
        )?;
    }
    if let Some(b) = report.between {
        say!(
            "agreement of {} observers over {} tiles: ICC {:.2} for one, {:.2} for their mean",
            b.observers,
            b.tiles,
            b.icc_single,
            b.icc_mean
        )?;
    }
    say_spread(report)?;
    say_groups(report)?;
    for c in &report.classes {
        let [low, high] = [c.wilson_low, c.wilson_high].map(|v| 100.0 * v);
        let class = format!("{:?}", c.class).to_lowercase();
        say!(
            "{class:9} identical in {:.1} % of {} answers (95 % interval {low:.1} to {high:.1} %)",
            100.0 * c.share,
            c.answers
        )?;
    }
    Ok(())
}

fn say_tiles(report: &StudyReport) -> Result<(), NotSaid> {
    if !report.tiles.is_empty() {
        say!("{COLUMNS}   95 % interval")?;
    }
    for t in &report.tiles {
        let interval = match t.level95_low.zip(t.level95_high) {
            Some((low, high)) => format!("{low:.0} to {high:.0}"),
            None => format!("none: {} observers, fewer than {LEAST_OBSERVERS}", t.observers),
        };
        let beyond = match t.level95_high {
            _ if t.beyond => "  beyond the stack".to_owned(),
            Some(high) if high > t.reference as f64 => {
                format!("  wider than the stack, whose reference has {}", t.reference)
            }
            _ => String::new(),
        };
        let doubt =
            if t.fit_probability.is_some_and(|p| p < 0.01) { "  the spread does not fit" } else { "" };
        let levels = [t.median, t.mean, t.level95];
        say_levels(&t.stack, t.tile, levels, &format!("   {interval}{beyond}{doubt}"))?;
    }
    if !report.tiles.is_empty() {
        say!("{WHAT_TRAIN_GETS}")?;
    }
    Ok(())
}

fn say_spread(report: &StudyReport) -> Result<(), NotSaid> {
    for s in &report.spread {
        let stack =
            s.stack.as_ref().map_or("spread of people in one place".to_owned(), |name| format!("  {name}"));
        let interval = match s.interval {
            Some([low, high]) => format!("95 % interval {low:.2} to {high:.2}"),
            None => "no interval: they hardly differ".to_owned(),
        };
        let left_out = match s.left_out {
            0 => String::new(),
            n => format!("; {n} tiles left out, whose median lies within ×4 of an end of the stack"),
        };
        say!(
            "{stack}: {:.2} in ln(samples), {interval}, of {} observers and {} tiles{left_out}",
            s.people,
            s.observers,
            s.tiles
        )?;
        if s.stack.is_none() {
            say!(
                "  of it {:.2} in all tiles alike and {:.2} by tile; one person, from showing to showing: {:.2}",
                s.common,
                s.by_place,
                s.within
            )?;
        }
    }
    Ok(())
}

fn say_groups(report: &StudyReport) -> Result<(), NotSaid> {
    for g in &report.groups {
        if let Some(line) = g.least_squares {
            say!(
                "{} against {}: T' = {:.3} T {:+.1}, {} tiles",
                g.to,
                g.from,
                line.slope,
                line.offset,
                g.tiles
            )?;
        }
        match (&g.robust, &g.problem) {
            (Some(fit), _) => {
                let r = fit.correlation.map_or("undefined".to_owned(), |r| format!("{r:.2}"));
                say!(
                    "  tolerating outliers: render --audience {:.4},{:.2} (r = {r})",
                    fit.line.slope,
                    fit.line.offset
                )?;
            }
            (None, Some(problem)) => say!("  no line that tolerates outliers: {problem}")?,
            (None, None) => {}
        }
    }
    Ok(())
}

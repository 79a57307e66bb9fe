//! A time limit.

use crate::pixels::verdict;
use noisefloor::{
    StoppingCriterion, Tile, TileGrid, Verdict,
    criterion::{CriterionError, View},
};
use std::time::{Duration, Instant};

/// Stops all tiles a number of seconds after the first verdict.
///
/// The clock starts at the first verdict, since a criterion may be made long before its run; the first batch
/// is therefore not counted. [`noisefloor::Driver::set_time_limit`] counts from the beginning, and stops
/// between verdicts, too. This is the only rival whose verdicts differ from run to run.
#[derive(Clone, Debug)]
pub struct TimeLimit {
    /// Seconds, at least 0.
    pub seconds: f64,
    began: Option<Instant>,
}

impl TimeLimit {
    /// A limit of `seconds`; one that is not a positive number has already passed.
    pub fn new(seconds: f64) -> Self {
        Self { seconds, began: None }
    }
}

impl StoppingCriterion for TimeLimit {
    fn name(&self) -> String {
        format!("{} seconds", self.seconds)
    }

    fn fingerprint(&self) -> String {
        self.name()
    }

    fn begin(&mut self, _: TileGrid) {
        self.began = None;
    }

    fn judge(&mut self, _: &View<'_>, tiles: &[Tile]) -> Result<Vec<Verdict>, CriterionError> {
        let elapsed = self.began.get_or_insert_with(Instant::now).elapsed();
        // A limit too long for a duration, such as infinity, is never reached
        let limit = Duration::try_from_secs_f64(self.seconds.max(0.0)).unwrap_or(Duration::MAX);
        Ok(vec![verdict(elapsed >= limit, None); tiles.len()])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{constant, view};

    #[test]
    fn the_clock_begins_with_the_first_verdict() {
        let film = constant(0.5, 100);
        let tiles: Vec<Tile> = film.grid().tiles().collect();
        let judge = |limit: &mut TimeLimit| limit.judge(&view(&film), &tiles).unwrap()[0].converged;

        // Long enough that no machine takes it between two lines; what passes is taken off the beginning
        let mut limit = TimeLimit::new(3600.0);
        assert!(!judge(&mut limit));
        limit.began = limit.began.map(|began| began.checked_sub(Duration::from_secs(3600)).unwrap());
        assert!(judge(&mut limit));
        limit.begin(film.grid());
        assert!(!judge(&mut limit));

        assert!(judge(&mut TimeLimit::new(0.0)));
        assert!(judge(&mut TimeLimit::new(-1.0)));
        assert!(judge(&mut TimeLimit::new(f64::NAN)));
        assert!(!judge(&mut TimeLimit::new(f64::INFINITY)));
    }
}

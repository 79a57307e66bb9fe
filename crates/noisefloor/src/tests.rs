//! What tests of several modules share.

use crate::criterion::{CriterionError, Needs, StoppingCriterion, Verdict, View};
use crate::session::Session;
use crate::tile::Tile;

/// All that a session knows, as a checkpoint has it.
pub(crate) fn saved<C: StoppingCriterion>(session: &Session<C>) -> Vec<u8> {
    let mut bytes = Vec::new();
    session.checkpoint("job").unwrap().write(&mut bytes).unwrap();
    bytes
}

/// A criterion that is a function of the tiles that are due, and cannot be saved.
struct Whim<F>(Needs, F);

pub(crate) fn judging(
    needs: Needs,
    judge: impl FnMut(&View<'_>, &[Tile]) -> Result<Vec<Verdict>, CriterionError> + Send + 'static,
) -> impl StoppingCriterion + Send + 'static {
    Whim(needs, judge)
}

/// The same by a function of each tile.
pub(crate) fn judging_each(
    needs: Needs,
    mut judge: impl FnMut(&View<'_>, &Tile) -> Verdict + Send + 'static,
) -> impl StoppingCriterion + Send + 'static {
    judging(needs, move |view, tiles| Ok(tiles.iter().map(|tile| judge(view, tile)).collect()))
}

impl<F> StoppingCriterion for Whim<F>
where
    F: FnMut(&View<'_>, &[Tile]) -> Result<Vec<Verdict>, CriterionError>,
{
    fn name(&self) -> String {
        "a whim".into()
    }

    fn fingerprint(&self) -> String {
        self.name()
    }

    fn needs(&self) -> Needs {
        self.0
    }

    fn judge(&mut self, view: &View<'_>, tiles: &[Tile]) -> Result<Vec<Verdict>, CriterionError> {
        (self.1)(view, tiles)
    }
}

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

type Judge = dyn FnMut(&View<'_>, &[Tile]) -> Result<Vec<Verdict>, CriterionError> + Send;

/// A criterion that is a function of the tiles that are due, and cannot be saved. It is one type whatever the function:
/// sessions of as many types as there are functions take a minute to compile.
pub(crate) struct Whim(Needs, Box<Judge>);

pub(crate) fn judging(
    needs: Needs,
    judge: impl FnMut(&View<'_>, &[Tile]) -> Result<Vec<Verdict>, CriterionError> + Send + 'static,
) -> Whim {
    Whim(needs, Box::new(judge))
}

/// The same by a function of each tile.
pub(crate) fn judging_each(
    needs: Needs,
    mut judge: impl FnMut(&View<'_>, &Tile) -> Verdict + Send + 'static,
) -> Whim {
    judging(needs, move |view, tiles| Ok(tiles.iter().map(|tile| judge(view, tile)).collect()))
}

impl StoppingCriterion for Whim {
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

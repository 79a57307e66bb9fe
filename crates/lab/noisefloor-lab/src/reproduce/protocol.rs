//! Which pairs a machine learns, and which it is asked about.

use super::pairs::Pairs;
use serde::{Deserialize, Serialize};

/// The paper does not say which pairs its 97.98 % are of: these are the ways to read it, and leaving scenes
/// out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PairProtocol {
    /// All pairs are learned, and asked about.
    Learned,
    /// A fifth of the pairs, drawn at random, is held out: other levels of the same tiles are learned.
    PairsHeldOut,
    /// Half of the scenes is learned, the other half asked about; and the other way round (Takouachet et
    /// al. 2017, §4.2.1: six and six).
    HalfTheScenes,
    /// Each scene is asked about by a machine that has learned all others.
    SceneLeftOut,
}

/// One of this many pairs is held out.
const FIFTH: usize = 5;

/// One machine: rows to learn and to ask about.
pub(super) struct Split {
    /// What it is asked about, in words.
    pub(super) asked: String,
    pub(super) learn: Vec<usize>,
    pub(super) ask: Vec<usize>,
}

impl PairProtocol {
    pub(super) const ALL: [Self; 4] =
        [Self::Learned, Self::PairsHeldOut, Self::HalfTheScenes, Self::SceneLeftOut];

    /// For files and tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Learned => "learned",
            Self::PairsHeldOut => "pairs-held-out",
            Self::HalfTheScenes => "half-the-scenes",
            Self::SceneLeftOut => "scene-left-out",
        }
    }

    /// Only synthesised pairs are learned; real ones are asked about with the synthesised ones of their
    /// scene.
    pub(super) fn splits(self, pairs: &Pairs) -> Vec<Split> {
        let (synthesised, all) = (0..pairs.synthesised, 0..pairs.known.len());
        let by_group = |asked: &[&str]| {
            let is_asked = |i: &usize| asked.contains(&pairs.known[*i].group.as_str());
            Split {
                asked: asked.join(", "),
                learn: synthesised.clone().filter(|i| !is_asked(i)).collect(),
                ask: all.clone().filter(is_asked).collect(),
            }
        };
        match self {
            Self::Learned => {
                let (learn, ask) = (synthesised.collect(), all.collect());
                vec![Split { asked: "all that was learned".into(), learn, ask }]
            }
            Self::PairsHeldOut => {
                let order = shuffled(pairs.synthesised);
                let (held_out, learn) = order.split_at(pairs.synthesised / FIFTH);
                let ask = held_out.iter().copied().chain(pairs.synthesised..pairs.known.len()).collect();
                vec![Split { asked: "a fifth of the pairs".into(), learn: learn.to_vec(), ask }]
            }
            Self::HalfTheScenes => {
                let groups = pairs.groups();
                let (one, other) = groups.split_at(half(pairs, &groups));
                vec![by_group(other), by_group(one)]
            }
            Self::SceneLeftOut => pairs.groups().iter().map(|&group| by_group(&[group])).collect(),
        }
    }
}

/// Where to cut the groups, so that both parts have about as many pairs; neither is empty.
fn half(pairs: &Pairs, groups: &[&str]) -> usize {
    let count = |groups: &[&str]| {
        pairs.known[..pairs.synthesised].iter().filter(|p| groups.contains(&p.group.as_str())).count()
    };
    let uneven = |&cut: &usize| count(&groups[..cut]).abs_diff(count(&groups[cut..]));
    (1..groups.len()).min_by_key(uneven).unwrap_or(1)
}

/// 0…n − 1 in a fixed random order (Fisher and Yates, with a linear congruential generator).
fn shuffled(n: usize) -> Vec<usize> {
    let mut order: Vec<usize> = (0..n).collect();
    let mut state = 2017u64;
    for i in (1..n).rev() {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        order.swap(i, (state >> 33) as usize % (i + 1));
    }
    order
}

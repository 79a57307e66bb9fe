//! Which samples a picture is made of, as far as whoever rendered it says.

use crate::evidence::Samples;

/// Where the samples of a picture come from. Files of the `noisefloor` command carry it, so that nobody has
/// to say whether two of them share samples.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct SampleOrigin {
    /// Scene and renderer.
    pub source: String,
    /// All options beside the seed that change the samples: compared as a whole.
    pub options: String,
    /// Seed of the source.
    pub seed: u64,
    /// Whether the seed fixes every sample ([`crate::Repeats::Samples`]): more samples then contain fewer.
    pub repeats: bool,
}

/// What the origins of two pictures say about their samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum OriginRelation {
    /// Nothing: they are of different scenes or renderers.
    Unknown,
    /// How the samples of one lie in those of the other.
    Known(Samples),
    /// The same scene, renderer and seed, with other options, or from a renderer that does not repeat its
    /// samples: they are made from the same random numbers, and nobody can tell how much of their noise they
    /// share.
    Dependent,
}

impl SampleOrigin {
    /// All that is known of them; `repeats` is [`SampleOrigin::repeats`].
    pub fn new(source: impl Into<String>, options: impl Into<String>, seed: u64, repeats: bool) -> Self {
        Self { source: source.into(), options: options.into(), seed, repeats }
    }

    /// Whether two pictures share samples. Different seeds of one scene and renderer give independent ones,
    /// whatever the other options are.
    pub(super) fn relation(&self, other: &Self) -> OriginRelation {
        if self.source != other.source {
            OriginRelation::Unknown
        } else if self.seed != other.seed {
            OriginRelation::Known(Samples::Independent)
        } else if self.options == other.options && self.repeats && other.repeats {
            OriginRelation::Known(Samples::Nested)
        } else {
            OriginRelation::Dependent
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_seed_of_one_scene_is_dependent_whatever_else_differs() {
        let origin = |source: &str, options: &str, seed, repeats| SampleOrigin {
            source: source.into(),
            options: options.into(),
            seed,
            repeats,
        };
        let one = origin("a", "x", 1, true);
        let (nested, independent) = (Samples::Nested, Samples::Independent);
        for (other, relation) in [
            (origin("a", "x", 1, true), OriginRelation::Known(nested)),
            (origin("a", "x", 2, true), OriginRelation::Known(independent)),
            (origin("a", "y", 2, true), OriginRelation::Known(independent)),
            (origin("a", "y", 1, true), OriginRelation::Dependent),
            (origin("a", "x", 1, false), OriginRelation::Dependent),
            (origin("a", "x", 2, false), OriginRelation::Known(independent)),
            (origin("b", "x", 1, true), OriginRelation::Unknown),
            (origin("b", "x", 2, true), OriginRelation::Unknown),
        ] {
            assert_eq!(one.relation(&other), relation, "{other:?}");
            assert_eq!(other.relation(&one), relation, "{other:?}");
        }
    }
}

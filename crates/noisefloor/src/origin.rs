//! Which samples a picture is made of, as far as whoever rendered it says.

use crate::evidence::Samples;

/// Where the samples of a picture come from. Files of the `noisefloor` command carry it, so that nobody has
/// to say whether two of them share samples.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SampleOrigin {
    /// All that decides which samples a seed gives: renderer, scene and options. Compared as a whole.
    pub source: String,
    /// Seed of the source.
    pub seed: u64,
    /// Whether the seed fixes every sample ([`crate::Repeats::Samples`]): more samples then contain fewer.
    pub repeats: bool,
}

impl SampleOrigin {
    /// Whether two pictures share samples. `None` if this does not tell: sources differ, or one seed does
    /// not give the same samples again.
    pub fn relation(&self, other: &Self) -> Option<Samples> {
        match (self.source == other.source, self.seed == other.seed) {
            (false, _) => None,
            (true, false) => Some(Samples::Independent),
            (true, true) => (self.repeats && other.repeats).then_some(Samples::Nested),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seeds_tell_only_within_a_source() {
        let of = |source: &str, seed, repeats| SampleOrigin { source: source.into(), seed, repeats };
        let one = of("a", 1, true);
        assert_eq!(one.relation(&of("a", 1, true)), Some(Samples::Nested));
        assert_eq!(one.relation(&of("a", 2, true)), Some(Samples::Independent));
        assert_eq!(one.relation(&of("b", 2, true)), None);
        assert_eq!(one.relation(&of("b", 1, true)), None);
        assert_eq!(of("a", 1, false).relation(&of("a", 1, false)), None);
        assert_eq!(of("a", 1, false).relation(&of("a", 2, false)), Some(Samples::Independent));
    }
}

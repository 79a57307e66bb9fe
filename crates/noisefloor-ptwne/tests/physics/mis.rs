//! Multiple importance sampling changes noise, not the mean.

use crate::kit::mean;
use noisefloor_ptwne::{Options, scenes};

#[test]
fn the_mean_is_the_same_with_and_without() {
    for name in ["cornell-box", "softbox", "courtyard"] {
        let run = |mis| {
            let options = Options { mis, seed: u64::from(mis), ..Options::default() };
            mean(scenes::by_name(name).unwrap(), 24, 64, 16, 1, options)
        };
        let ((with, e1), (without, e2)) = (run(true), run(false));
        let z = (with - without) / e1.hypot(e2);
        assert!(z.abs() < 5.0, "{name}: {with} ± {e1}, {without} ± {e2}");
    }
}

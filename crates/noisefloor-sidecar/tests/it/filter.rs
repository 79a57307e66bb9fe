//! Filters of pictures.

use noisefloor::Rgb;
use noisefloor_sidecar::{Device, FilterPlan, PictureFilter, Renderer, SidecarCause, SidecarError};
use noisefloor_testkit::require_python;

const FILTER: Renderer = Renderer {
    name: "fakefilter",
    title: "Fake filter",
    script: include_str!("fake_filter.py"),
    requirements: "",
    pythons: &[10, 11, 12, 13, 14],
    probe: "print('1.0')",
};

/// A picture of 2×1 pixels.
fn apply(filter: &mut PictureFilter, first: f32) -> Result<Vec<Rgb>, SidecarError> {
    let [made] = filter.apply((2, 1), [&[("radiance", &[[first, 1.0, 2.0], [3.0; 3]])]])?;
    Ok(made)
}

#[test]
fn a_filter_turns_pictures_into_one_whatever_happened_before() {
    let Some(python) = require_python() else { return };
    let mut filter = PictureFilter::open(&FILTER, &python, FilterPlan::default()).unwrap();
    assert_eq!(filter.name(), "Fake filter, threads None");
    assert_eq!(filter.warnings(), ["on None"]);
    let plan = FilterPlan { device: Some(Device::AUTO), ..FilterPlan::default() };
    assert_eq!(PictureFilter::open(&FILTER, &python, plan).unwrap().warnings(), ["on auto"]);
    let doubled = vec![[0.5, 2.0, 4.0], [6.0; 3]];
    assert_eq!(apply(&mut filter, 0.25).unwrap(), doubled);
    let albedo = [[0.0; 3]; 2];
    let [two] = filter.apply((2, 1), [&[("radiance", &[[0.0; 3]; 2]), ("albedo", &albedo)]]).unwrap();
    assert_eq!(two, [[1.0; 3]; 2]);
    // Frames are told apart
    let frame = |value: f32| [("radiance", [[value; 3]; 2])];
    let frames = [frame(1.0), frame(2.0)];
    let [one, other] = frames.each_ref().map(|[(name, pixels)]| [(*name, pixels.as_slice())]);
    assert_eq!(filter.apply((2, 1), [&one, &other]).unwrap(), [vec![[2.0; 3]; 2], vec![[4.0; 3]; 2]]);

    let cause = |outcome: Result<Vec<Rgb>, SidecarError>| *outcome.unwrap_err().cause;
    for (first, said) in [(-2.0, "this picture is refused"), (-3.0, "not finite"), (-4.0, "12 bytes for 2x1")]
    {
        let cause = cause(apply(&mut filter, first));
        assert!(matches!(&cause, SidecarCause::Refused(why) if why.contains(said)), "{first}: {cause:?}");
        assert_eq!(apply(&mut filter, 0.25).unwrap(), doubled);
    }
    assert!(matches!(cause(apply(&mut filter, -1.0)), SidecarCause::Died { .. }));
    assert_eq!(apply(&mut filter, 0.25).unwrap(), doubled);

    // Nothing is sent that does not fit
    for (size, pixels) in [((2, 2), 2), ((0, 5), 0), ((usize::MAX, 2), 2)] {
        let outcome = filter.apply(size, [&[("radiance", &vec![[0.0; 3]; pixels])]]).map(|[made]| made);
        assert!(matches!(cause(outcome), SidecarCause::Refused(_)), "{size:?}");
    }
    let outcome =
        filter.apply((2, 1), [&[("radiance", &albedo)], &[("albedo", &albedo)]]).map(|[made, _]| made);
    assert!(matches!(cause(outcome), SidecarCause::Refused(why) if why.contains("different names")));
}

//! Colour profiles (ICC) that PNGs hold.

use crate::colours::{Curve, Stated, ToRec709};
use moxcms::{ColorProfile, DataColorSpace, ProfileText, ToneReprCurve};
use noisefloor::text::printable;

/// A profile of three primaries and their curves, or of a grey.
pub(crate) fn stated(profile: &[u8]) -> Result<Stated, String> {
    let unreadable = |reason: &dyn std::fmt::Display| format!("those of a broken profile ({reason})");
    let profile = ColorProfile::new_from_slice(profile).map_err(|e| unreadable(&e))?;
    let name = match &profile.description {
        Some(ProfileText::PlainString(name)) => printable(name),
        Some(ProfileText::Localizable(names)) => {
            names.first().map(|n| printable(&n.value)).unwrap_or_default()
        }
        Some(ProfileText::Description(name)) => printable(&name.ascii_string),
        None => "without a name".into(),
    };
    let tables =
        [&profile.lut_a_to_b_perceptual, &profile.lut_a_to_b_colorimetric, &profile.lut_a_to_b_saturation];
    let grey = profile.color_space == DataColorSpace::Gray;
    let curves = match (&profile.red_trc, &profile.green_trc, &profile.blue_trc, &profile.gray_trc) {
        (_, _, _, Some(k)) if grey => [k, k, k],
        (Some(r), Some(g), Some(b), _) if profile.is_matrix_shaper() => [r, g, b],
        _ => return Err(format!("those of the profile “{name}”, which is no three primaries with curves")),
    };
    if tables.iter().any(|table| table.is_some()) {
        return Err(format!("those of the profile “{name}”, which is a table rather than primaries"));
    }
    let matrix = if grey {
        None
    } else {
        let colorants = [profile.red_colorant, profile.green_colorant, profile.blue_colorant];
        let rows = [colorants.map(|c| c.x), colorants.map(|c| c.y), colorants.map(|c| c.z)];
        Some(ToRec709::of_profile(rows).ok_or_else(|| unreadable(&"its primaries are no colours"))?)
    };
    let [r, g, b] = curves.map(table);
    let curve = || Some(Curve::Table(Box::new([r?, g?, b?])));
    let curve = curve().ok_or_else(|| unreadable(&"its curves are none"))?;
    Ok(Stated { gamut: None, matrix, curve })
}

/// The light of every code of 16 bits, and of 8, which are among them.
fn table(curve: &ToneReprCurve) -> Option<Vec<f32>> {
    let curve = curve.make_linear_evaluator().ok()?;
    let table: Vec<f32> = (0..=65535).map(|code| curve.evaluate_value(code as f32 / 65535.0)).collect();
    table.iter().all(|v| (-1.0..=2.0).contains(v)).then_some(table)
}

//! Directives that move what comes next.

use super::arguments::Arguments;
use super::reader::Reader;
use crate::error::{LoadError, Place};
use glam::{DMat4, DVec3};

impl Reader<'_> {
    /// Executes such a directive. The result is whether it was one.
    pub(super) fn moves(&mut self, word: &str, args: &mut Arguments<'_, '_>) -> Result<bool, LoadError> {
        let place = args.place();
        let step = match word {
            "Identity" => {
                self.state.to_world = DMat4::IDENTITY;
                return Ok(true);
            }
            "Translate" => DMat4::from_translation(args.numbers::<3>()?.into()),
            "Scale" => DMat4::from_scale(args.numbers::<3>()?.into()),
            "Rotate" => {
                let [angle, x, y, z] = args.numbers()?;
                let axis = DVec3::new(x, y, z).try_normalize();
                let axis = axis.ok_or_else(|| place.bad("a rotation needs an axis that is not 0"))?;
                DMat4::from_axis_angle(axis, angle.to_radians())
            }
            "LookAt" => look_at(args.numbers()?, &place)?,
            "Transform" => {
                self.state.to_world = DMat4::from_cols_array(&args.numbers()?);
                return Ok(true);
            }
            "ConcatTransform" => DMat4::from_cols_array(&args.numbers()?),
            "CoordinateSystem" => {
                let name = args.text()?;
                self.coordinate_systems.insert(name, self.state.to_world);
                return Ok(true);
            }
            "CoordSysTransform" => {
                let name = args.text()?;
                let found = self.coordinate_systems.get(&name).copied();
                self.state.to_world =
                    found.ok_or_else(|| place.bad(format!("there is no coordinate system `{name}`")))?;
                return Ok(true);
            }
            "TransformTimes" => {
                args.numbers::<2>()?;
                return Ok(true);
            }
            "ActiveTransform" => {
                args.pass()?;
                self.load.approximated(&place, "everything stays where it is when the shutter opens");
                return Ok(true);
            }
            _ => return Ok(false),
        };
        self.state.to_world *= step;
        if self.state.to_world.is_finite() { Ok(true) } else { Err(place.bad("the transform is too large")) }
    }
}

/// From the world to a camera at `eye` that looks along +z, with +y up and +x to the right.
fn look_at(numbers: [f64; 9], place: &Place) -> Result<DMat4, LoadError> {
    let [eye, target, up] = [0, 3, 6].map(|i| DVec3::new(numbers[i], numbers[i + 1], numbers[i + 2]));
    let view = (target - eye).try_normalize();
    let axes = view.and_then(|view| {
        let right = up.normalize_or_zero().cross(view).try_normalize()?;
        Some([right, view.cross(right), view])
    });
    let what = "eye and target are the same, or `up` points along the view";
    let [x, y, z] = axes.ok_or_else(|| place.bad(what))?;
    let to_world = DMat4::from_cols(x.extend(0.0), y.extend(0.0), z.extend(0.0), eye.extend(1.0));
    Ok(to_world.inverse())
}

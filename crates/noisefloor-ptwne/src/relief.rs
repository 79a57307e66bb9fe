//! Relief: shading normals that follow a texture.

use crate::checks::check_range;
use crate::error::SceneError;
use crate::math::Vec3;
use crate::texture::{Coordinates, Texture, twice};

/// Largest factor on a relief.
const MAX_SCALE: f32 = 1e6;

/// Structure too fine for geometry. It turns the shading normal of a surface, and nothing else: outlines and
/// shadows stay those of the geometry, and light never passes through a surface that reflects it.
///
/// It follows the texture coordinates; where a triangle has none that span it, it is left out. A normal of
/// which the camera would see the back, or that would mirror what is behind the surface, is bent towards the
/// geometric normal, as little as is needed.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Relief {
    /// Normals. Channels of 0…1 stand for −1…1: red along the direction of growing u, green to the left of that
    /// as seen from the front, blue along the shading normal.
    Normals {
        /// The normals; linear, not sRGB-encoded.
        map: Texture,
        /// Factor on red and green, −10⁶…10⁶.
        scale: f32,
        /// Whether green points along growing v where texture coordinates are mirrored, as in glTF.
        mirrors: bool,
    },
    /// Heights along the shading normal (Blinn 1978): the mean of the channels.
    Heights {
        map: Texture,
        /// Their unit, in scene units: −10⁶…10⁶.
        scale: f32,
    },
}

impl Relief {
    pub(crate) fn check(&self) -> Result<(), SceneError> {
        let (Self::Normals { map, scale, .. } | Self::Heights { map, scale }) = self;
        check_range("the scale of a relief", *scale, [-MAX_SCALE, MAX_SCALE], "-1e6…1e6")?;
        map.check()
    }

    /// Whether it is along growing coordinates, so that tangents of a mesh can stand for these.
    pub(crate) fn is_of_normals(&self) -> bool {
        matches!(self, Self::Normals { .. })
    }

    /// Whether it takes the second texture coordinates.
    pub(crate) fn is_second(&self) -> bool {
        let (Self::Normals { map, .. } | Self::Heights { map, .. }) = self;
        map.is_second()
    }

    /// The shading normal `n` of the front, turned. `along` are the derivatives of the position by u and v.
    /// `None` if it stays as it is.
    pub(crate) fn turned(&self, n: Vec3, along: [Vec3; 2], at: Coordinates) -> Option<Vec3> {
        // Along the plane of the shading normal
        let [du, dv] = along.map(|d| d - n * n.dot(d));
        match self {
            Self::Normals { map, scale, mirrors } => {
                let c = map.eval(at) * 2.0 - Vec3::ONE;
                let (x, mut y) = (c.x * scale, c.y * scale);
                if x == 0.0 && y == 0.0 {
                    return None;
                }
                let s = du.try_normalize()?;
                let t = n.cross(s);
                if *mirrors && t.dot(dv) < 0.0 {
                    y = -y;
                }
                (s * x + t * y + n * c.z).try_normalize()
            }
            Self::Heights { map, scale } => {
                let [hu, hv] = slope(map, at).map(|slope| slope * scale);
                if hu == 0.0 && hv == 0.0 {
                    return None;
                }
                let turned = (du + n * hu).cross(dv + n * hv).try_normalize()?;
                // Mirrored texture coordinates turn it round
                Some(if turned.dot(n) < 0.0 { -turned } else { turned })
            }
        }
    }
}

/// The slopes of a texture's mean channel along u and v.
fn slope(map: &Texture, at: Coordinates) -> [f32; 2] {
    let height = |c: Vec3| (c.x + c.y + c.z) * (1.0 / 3.0);
    let Texture::Image(image) = map else {
        const STEP: f32 = 1e-3;
        let [u, v, ..] = at;
        let rise = |to: [f32; 2], from: [f32; 2]| {
            (height(map.eval(twice(to))) - height(map.eval(twice(from)))) / (2.0 * STEP)
        };
        return [rise([u + STEP, v], [u - STEP, v]), rise([u, v + STEP], [u, v - STEP])];
    };
    let [u, v] = image.own(at);
    // An eighth of a pixel, so that nearly all differences are those of bilinear interpolation
    let [x, y] = image.to_uv.map(|row| row[0] * u + row[1] * v + row[2]);
    let (dx, dy) = (0.125 / image.width as f32, 0.125 / image.height as f32);
    let along_x = (height(image.at(x + dx, y)) - height(image.at(x - dx, y))) / (2.0 * dx);
    let along_y = (height(image.at(x, y + dy)) - height(image.at(x, y - dy))) / (2.0 * dy);
    let [rx, ry] = image.to_uv;
    [along_x * rx[0] + along_y * ry[0], along_x * rx[1] + along_y * ry[1]]
}

/// `n`, or the first normal on the way from it to `flat` that can be seen from `wo`, and which, if `shiny`, mirrors
/// `wo` to the side of `flat`. `flat` is on the side of `wo`.
pub(crate) fn bent(n: Vec3, flat: Vec3, wo: Vec3, shiny: bool) -> Vec3 {
    // A little is kept of the angle to the horizon, so that pictures do not tear there
    let least = 0.05 * wo.dot(flat);
    let fits = |n: Vec3| {
        let (seen, up) = (n.dot(wo), n.dot(flat));
        up > 0.0 && seen >= least && (!shiny || 2.0 * seen * up - wo.dot(flat) >= least)
    };
    if fits(n) {
        return n;
    }
    // Bisection: what fits stays at `high`
    let (mut low, mut high, mut best) = (0.0, 1.0, flat);
    for _ in 0..10 {
        let middle = 0.5 * (low + high);
        let between = n.lerp(flat, middle).normalize_or_zero();
        if fits(between) {
            (high, best) = (middle, between);
        } else {
            low = middle;
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{reflect, sphere};

    fn normals(colour: [f32; 3], scale: f32, mirrors: bool) -> Relief {
        Relief::Normals { map: Texture::Colour(colour), scale, mirrors }
    }

    #[test]
    fn normals_are_those_of_the_frame() {
        let along = [Vec3::X * 3.0, Vec3::Y * 0.1];
        let turned = |relief: Relief, along| relief.turned(Vec3::Z, along, twice([0.3, 0.7]));
        assert_eq!(turned(normals([0.5, 0.5, 1.0], 1.0, false), along), None);
        // (0.6, 0, 0.8) and (0, −0.6, 0.8)
        let close = |a: Option<Vec3>, b: [f32; 3]| (a.unwrap() - Vec3::from(b)).length() < 1e-6;
        assert!(close(turned(normals([0.8, 0.5, 0.9], 1.0, false), along), [0.6, 0.0, 0.8]));
        assert!(close(turned(normals([0.5, 0.2, 0.9], 1.0, false), along), [0.0, -0.6, 0.8]));
        // Half of it: (0.3, 0, 0.8) / √0.73
        let half = 0.73f32.sqrt().recip();
        assert!(close(turned(normals([0.8, 0.5, 0.9], 0.5, false), along), [0.3 * half, 0.0, 0.8 * half]));
        // Mirrored: v runs down, and green is still up, unless it follows v
        let mirrored = [Vec3::X, -Vec3::Y];
        assert!(close(turned(normals([0.5, 0.2, 0.9], 1.0, false), mirrored), [0.0, -0.6, 0.8]));
        assert!(close(turned(normals([0.5, 0.2, 0.9], 1.0, true), mirrored), [0.0, 0.6, 0.8]));
        assert_eq!(turned(normals([0.8, 0.5, 0.9], 1.0, false), [Vec3::Z, Vec3::Y]), None);
    }

    #[test]
    fn heights_are_slopes() {
        use crate::texture::{ImageTexture, Pixels, Wrap};
        // A ramp: the height is u, in pixels of 1/8
        let ramp: Vec<[f32; 3]> = (0..8).map(|i| [(i as f32 + 0.5) / 8.0; 3]).collect();
        let image =
            ImageTexture { wrap: [Wrap::Clamp; 2], ..ImageTexture::new(8, 1, Pixels::Float(ramp.into())) };
        let relief = Relief::Heights { map: Texture::Image(image), scale: 2.0 };
        // u runs 4 units along x, over which the height grows by 2: a slope of 1/2
        for dv in [Vec3::Y, -Vec3::Y] {
            let turned = relief.turned(Vec3::Z, [Vec3::X * 4.0, dv], twice([0.4, 0.5])).unwrap();
            let expected = Vec3::new(-0.5, 0.0, 1.0).normalize();
            assert!((turned - expected).length() < 1e-4, "{turned}");
        }
        let flat = Relief::Heights { map: Texture::Colour([0.3; 3]), scale: 2.0 };
        assert_eq!(flat.turned(Vec3::Z, [Vec3::X, Vec3::Y], twice([0.4, 0.5])), None);
    }

    #[test]
    fn bent_normals_can_be_seen_and_mirror_outwards() {
        let (mut kept, mut all) = (0, 0);
        for i in 0..2000 {
            let u = |k: u32| (i * k % 2000) as f32 / 2000.0;
            let (n, mut wo) = (sphere([u(7), u(13)]), sphere([u(3), u(29)]));
            wo.z = wo.z.abs().max(1e-4);
            let wo = wo.normalize();
            for shiny in [false, true] {
                let turned = bent(n, Vec3::Z, wo, shiny);
                assert!((turned.length() - 1.0).abs() < 1e-5);
                assert!(turned.dot(wo) > 0.0 && turned.z > 0.0, "{n} {wo}: {turned}");
                assert!(!shiny || reflect(-wo, turned).z > 0.0, "{n} {wo}: {turned}");
                kept += u32::from(turned == n);
                all += 1;
            }
        }
        // Not all are bent: of a random normal and a random view, about a third fit
        assert!(kept * 5 > all && kept < all);
    }
}

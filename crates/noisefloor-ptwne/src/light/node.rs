//! Four clusters of lights side by side, and their importance for a receiver.

use super::cluster::Cluster;
use super::receiver::Receiver;
use crate::math::Vec3;
use glam::Vec4;
use std::f32::consts::PI;

/// "No node" and "no slot".
pub(super) const NONE: u32 = u32::MAX;
/// Flags a child that is a patch of lights; the other bits are its index.
pub(super) const LEAF: u32 = 1 << 31;
/// Cosines below this count as this in the geometric importance, which must not starve lights at grazing
/// angles.
const LEAST_COSINE: f32 = 0.1;
/// Lights that bounds place this little below a horizon may still be above it, by rounding.
const SLACK: f32 = 1e-4;

/// Up to four clusters, one per lane. Empty lanes have no intensity and no count.
#[derive(Clone, Debug)]
pub(super) struct Node {
    centre: [Vec4; 3],
    radius: Vec4,
    /// The largest reciprocal of a distance: no closer than the radius.
    most_inverse: Vec4,
    /// Half the edges of the bounding box.
    half: [Vec4; 3],
    /// How far behind the centre, along the axis, receivers can be.
    behind: Vec4,
    axis: [Vec4; 3],
    cos_spread: Vec4,
    sin_spread: Vec4,
    cos_emission: Vec4,
    sin_emission: Vec4,
    two_sided: Vec4,
    /// One for what shines alike in all directions, and has no axis; or zero.
    round: Vec4,
    /// Whether all lights shine in all directions, so that cones do not matter.
    all_round: bool,
    /// Relative to that of all lights.
    intensity: Vec4,
    /// Seen along the normals.
    area: Vec4,
    count: Vec4,
    pub(super) child: [u32; 4],
    /// Four times the parent's index, plus its lane; [`NONE`] for the root.
    pub(super) parent: u32,
}

/// The importance of four clusters.
#[derive(Clone, Copy, Debug)]
pub(super) struct Importance {
    /// An estimate of the light that the receiver scatters to where it is seen from, were nothing in between.
    pub(super) scattered: Vec4,
    /// By position and direction only, regardless of intensity.
    pub(super) geometric: Vec4,
}

impl Importance {
    pub(super) const NONE: Self = Self { scattered: Vec4::ZERO, geometric: Vec4::ZERO };
}

impl Node {
    pub(super) fn new(parent: u32) -> Self {
        let zero = [Vec4::ZERO; 3];
        Self {
            centre: zero,
            radius: Vec4::ZERO,
            most_inverse: Vec4::ZERO,
            half: zero,
            behind: Vec4::ZERO,
            axis: zero,
            cos_spread: Vec4::ONE,
            sin_spread: Vec4::ZERO,
            cos_emission: Vec4::ZERO,
            sin_emission: Vec4::ONE,
            two_sided: Vec4::ZERO,
            round: Vec4::ZERO,
            all_round: true,
            intensity: Vec4::ZERO,
            area: Vec4::ZERO,
            count: Vec4::ZERO,
            child: [NONE; 4],
            parent,
        }
    }

    /// Puts a cluster into a lane. `scale` makes intensities relative; no distance counts as less than
    /// `least`.
    pub(super) fn set(&mut self, lane: usize, cluster: &Cluster, scale: f64, least: f32, child: u32) {
        let round = cluster.spread >= PI;
        for axis in 0..3 {
            self.centre[axis][lane] = cluster.centre[axis];
            self.axis[axis][lane] = if round { 0.0 } else { cluster.axis[axis] };
            self.half[axis][lane] = 0.5 * cluster.size()[axis] * 1.001;
        }
        // Rounding must not lose a light
        self.radius[lane] = cluster.radius * 1.001;
        self.behind[lane] = cluster.behind + SLACK * cluster.radius;
        self.most_inverse[lane] = 1.0 / self.radius[lane].max(least);
        (self.sin_spread[lane], self.cos_spread[lane]) = cluster.spread.sin_cos();
        (self.sin_emission[lane], self.cos_emission[lane]) = cluster.emission.sin_cos();
        self.two_sided[lane] = if cluster.two_sided { 1.0 } else { 0.0 };
        self.intensity[lane] = (cluster.intensity * scale) as f32;
        self.all_round &= round;
        self.round[lane] = if round { 1.0 } else { 0.0 };
        self.area[lane] = cluster.area;
        self.count[lane] = cluster.count as f32;
        self.child[lane] = child;
    }

    /// The importance of the four clusters (Conty Estevez, Kulla 2018, eq. 3, with a lobe for glossy
    /// receivers). Zero only for clusters that send no light to the receiver.
    #[inline]
    pub(super) fn importance(&self, receiver: &Receiver) -> Importance {
        let dot = |a: &[Vec4; 3], b: Vec3| a[0] * b.x + a[1] * b.y + a[2] * b.z;
        let p = receiver.position;
        let to = [self.centre[0] - p.x, self.centre[1] - p.y, self.centre[2] - p.z];
        let d2 = to[0] * to[0] + to[1] * to[1] + to[2] * to[2];
        let inverse = d2.max(Vec4::splat(f32::MIN_POSITIVE)).sqrt().recip();

        // The angle that the bounding sphere subtends; from inside, all directions
        let sin = self.radius * inverse;
        let inside = sin.cmpge(Vec4::ONE);
        let sphere = Angle {
            cos: Vec4::select(inside, Vec4::NEG_ONE, (Vec4::ONE - sin * sin).sqrt()),
            sin: Vec4::select(inside, Vec4::ZERO, sin),
        };

        let near = inverse.min(self.most_inverse);
        let squared = near * near;

        // Height above the receiver's horizon: of the middle, and of the highest corner of the box
        let height = dot(&to, receiver.normal);
        let top = height + dot(&self.half, receiver.normal.abs());
        let mut visible = top.cmpge(self.radius * -SLACK);
        let horizon = middling(height * near, top * near);
        let mut facing = Vec4::ONE;
        if !self.all_round {
            let along = self.axis[0] * to[0] + self.axis[1] * to[1] + self.axis[2] * to[2];
            let cos = along * -inverse + self.round;
            let cos = Vec4::select(self.two_sided.cmpgt(Vec4::ZERO), cos.abs(), cos);
            // The receiver may be off the axis by the spread of normals, the sphere and the emission together
            let (cos_wide, sin_wide) = (
                self.cos_spread * sphere.cos - self.sin_spread * sphere.sin,
                self.sin_spread * sphere.cos + self.cos_spread * sphere.sin,
            );
            let always = inside | cos_wide.cmple(-self.cos_emission) | sin_wide.cmplt(Vec4::ZERO);
            let least = cos_wide * self.cos_emission - sin_wide * self.sin_emission;
            visible &= (always | cos.cmpge(least - SLACK)) & along.cmple(self.behind);
            facing = middling(cos, cos + Vec4::select(always, Vec4::ONE, sin_wide));
        }

        let mut scattering = receiver.diffuse * horizon;
        if receiver.glossy > 0.0 {
            let mirror = Angle::new(dot(&to, receiver.mirror) * inverse).minus(&sphere).cos;
            scattering +=
                receiver.glossy * lobe(mirror, receiver.alpha2, self.radius * self.radius * squared);
        }
        // The share of rays scattered by the receiver that find the lights: they need fewer samples
        let found = self.area * facing * scattering * squared * receiver.share;
        let keep = |x: Vec4| Vec4::select(visible, x, Vec4::ZERO);
        let least = |x: Vec4| x.max(Vec4::splat(LEAST_COSINE));
        Importance {
            scattered: keep(self.intensity * facing * scattering * squared / (1.0 + found)),
            geometric: keep(self.count * least(facing) * least(horizon) * squared),
        }
    }
}

/// A normalised lobe of GGX at an angle from the mirrored direction, for a light that subtends π·`size`. No
/// more than the whole lobe falls into a light.
#[inline]
fn lobe(cos: Vec4, alpha2: f32, size: Vec4) -> Vec4 {
    // The half vector turns half as far as the direction
    let cos2 = (0.5 + 0.5 * cos).clamp(Vec4::ZERO, Vec4::ONE);
    let k = cos2 * alpha2 + (Vec4::ONE - cos2);
    // D/4 = a/πk², over 1 + D/4·π·size
    let a = 0.25 * alpha2;
    Vec4::splat(a / PI) / (k * k + a * size)
}

/// A cosine for a light of which only a part may be above a horizon: that of its middle, or half of the largest,
/// of its top.
#[inline]
fn middling(middle: Vec4, top: Vec4) -> Vec4 {
    middle.max(0.5 * top).clamp(Vec4::ZERO, Vec4::ONE)
}

/// Cosines and sines of four angles of 0 to π.
struct Angle {
    cos: Vec4,
    sin: Vec4,
}

impl Angle {
    #[inline]
    fn new(cos: Vec4) -> Self {
        Self { cos, sin: (Vec4::ONE - cos * cos).max(Vec4::ZERO).sqrt() }
    }

    /// The difference, at least 0.
    #[inline]
    fn minus(&self, other: &Self) -> Self {
        let below = self.cos.cmpgt(other.cos);
        let cos = self.cos * other.cos + self.sin * other.sin;
        let sin = self.sin * other.cos - self.cos * other.sin;
        Self { cos: Vec4::select(below, Vec4::ONE, cos), sin: Vec4::select(below, Vec4::ZERO, sin) }
    }
}

//! Choosing one of many lights, by what a receiver is likely to scatter of each.

use super::cluster::Cluster;
use super::emitter::{Light, LightShape};
use super::node::Importance;
use super::receiver::Receiver;
use super::tree::{LightTree, Pmf};
use crate::math::{self, Vec3};
use std::f32::consts::PI;

/// Share of the choices that goes by position and direction only. It bounds the noise where lights that look
/// strong are hidden, or where the estimate of what a glossy receiver scatters is poor.
const GEOMETRIC_SHARE: f32 = 0.2;

/// All lights of a scene: those that have a position in a tree, and those that are infinitely far away in a
/// list.
#[derive(Clone, Debug)]
pub(crate) struct Lights {
    pub(crate) all: Vec<Light>,
    /// The only light that matters, if there is just one.
    only: Option<usize>,
    tree: LightTree,
    far: Vec<FarLight>,
}

/// What a receiver can expect of all lights: the first step of every choice, and of every probability.
#[derive(Clone, Debug)]
pub(crate) struct Prospect {
    receiver: Receiver,
    /// Of the clusters at the top of the tree.
    root: Importance,
    /// Weights of all far lights, and of the tree beside them.
    far: Pmf,
    tree: Pmf,
}

/// A light that is infinitely far away.
#[derive(Clone, Copy, Debug)]
struct FarLight {
    light: usize,
    /// Irradiance of a surface that faces it, relative as in the tree.
    irradiance: f32,
    /// Direction towards it; none for the environment map.
    dir: Option<Vec3>,
    /// Sine of its half angle.
    sin: f32,
}

impl Lights {
    /// The lights of a scene whose bounding box has these corners; `textures` are the means of its emission
    /// textures. Lights that cannot matter, which are black or face away from the whole scene, are never
    /// chosen.
    pub(crate) fn new(mut all: Vec<Light>, [low, high]: [Vec3; 2], textures: &[Vec3]) -> Self {
        let extent = 0.5 * (high - low).length();
        let texture = |l: &Light| textures.get(l.texture as usize).copied().unwrap_or(Vec3::ONE);
        let power = |l: &Light| {
            if l.reaches(low, high) { f64::from(l.power(extent, texture(l))) } else { 0.0 }
        };
        let powers: Vec<f64> = all.iter().map(power).collect();
        let total: f64 = powers.iter().sum();
        for (light, power) in all.iter_mut().zip(&powers) {
            light.power_pmf = if total > 0.0 { (power / total) as f32 } else { 0.0 };
        }

        let active = || all.iter().enumerate().filter(|(i, _)| powers[*i] > 0.0);
        let clusters = active().filter_map(|(i, l)| Some((i as u32, Cluster::of(l, texture(l))?)));
        let clusters: Vec<_> = clusters.collect();
        let intensity: f64 = clusters.iter().map(|(_, cluster)| cluster.intensity).sum();
        let scale = if intensity > 0.0 { 1.0 / intensity } else { 1.0 };
        let far = active().filter_map(|(i, l)| FarLight::of(i, l, scale)).collect();
        let mut indices = active().map(|(i, _)| i);
        let only = indices.next().filter(|_| indices.next().is_none());
        Self { only, tree: LightTree::new(clusters, all.len(), scale, extent), far, all }
    }

    /// What a receiver can expect of the lights.
    #[inline]
    pub(crate) fn prospect(&self, receiver: Receiver) -> Prospect {
        let mut prospect = Prospect::unknown(receiver);
        self.weigh(&mut prospect);
        prospect
    }

    #[inline]
    fn weigh(&self, prospect: &mut Prospect) {
        if self.only.is_some() {
            return;
        }
        let receiver = prospect.receiver;
        for far in &self.far {
            prospect.far.scattered += far.weight(&receiver, false);
            prospect.far.geometric += far.weight(&receiver, true);
        }
        if let Some(root) = self.tree.root(&receiver) {
            prospect.tree.scattered = root.scattered.element_sum();
            // By geometry, half of the choices go to far lights
            prospect.tree.geometric = if prospect.far.geometric > 0.0 { prospect.far.geometric } else { 1.0 };
            prospect.root = root;
        }
    }

    /// Chooses a light for a receiver by two numbers uniform in [0, 1), of which the second only extends the
    /// first. Returns its index and the probability of the choice; none if no light was found that can
    /// matter.
    #[inline]
    pub(crate) fn choose(&self, prospect: &Prospect, u: f32, more: f32) -> Option<(usize, f32)> {
        if let Some(only) = self.only {
            return Some((only, 1.0));
        }
        let u = f64::from(u) + f64::from(more) * 2f64.powi(-24);
        let share = f64::from(GEOMETRIC_SHARE);
        let geometric = u < share;
        let u = if geometric { u / share } else { (u - share) / (1.0 - share) };

        // Far lights first, then the tree
        let chosen = |weights: Pmf| f64::from(if geometric { weights.geometric } else { weights.scattered });
        let of_tree = chosen(prospect.tree);
        let mut rest = u * (chosen(prospect.far) + of_tree);
        for far in &self.far {
            let weight = f64::from(far.weight(&prospect.receiver, geometric));
            if rest < weight {
                return Some((far.light, prospect.mixed(far.weights(&prospect.receiver))));
            }
            rest -= weight;
        }
        if of_tree <= 0.0 {
            return None;
        }
        let u = (rest / of_tree).clamp(0.0, 1.0 - f64::EPSILON);
        let (light, pmf) = self.tree.choose(&prospect.receiver, &prospect.root, u, geometric)?;
        Some((light, prospect.of_tree(pmf)))
    }

    /// The probability with which [`Lights::choose`] chooses a light for a receiver.
    #[inline]
    pub(crate) fn pmf(&self, prospect: &Prospect, light: usize) -> f32 {
        if let Some(only) = self.only {
            return if only == light { 1.0 } else { 0.0 };
        }
        if self.tree.contains(light) {
            return prospect.of_tree(self.tree.pmf(&prospect.receiver, &prospect.root, light));
        }
        let far = self.far.iter().find(|far| far.light == light);
        far.map_or(0.0, |far| prospect.mixed(far.weights(&prospect.receiver)))
    }

    /// Memory that it takes, in bytes.
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(self.all.as_slice()) + self.tree.bytes()
    }
}

impl Prospect {
    /// Of lights that are not known.
    #[inline]
    pub(crate) fn unknown(receiver: Receiver) -> Self {
        let none = Pmf { scattered: 0.0, geometric: 0.0 };
        Self { receiver, root: Importance::NONE, far: none, tree: none }
    }

    /// The probability of a light of the tree, given that the tree was chosen with the probability `pmf`.
    #[inline]
    fn of_tree(&self, pmf: Pmf) -> f32 {
        let (scattered, geometric) =
            (pmf.scattered * self.tree.scattered, pmf.geometric * self.tree.geometric);
        self.mixed(Pmf { scattered, geometric })
    }

    /// The probability of what has these weights beside all other lights.
    #[inline]
    fn mixed(&self, weights: Pmf) -> f32 {
        let share = |weight: f32, all: f32| if all > 0.0 { weight / all } else { 0.0 };
        let scattered = share(weights.scattered, self.far.scattered + self.tree.scattered);
        let geometric = share(weights.geometric, self.far.geometric + self.tree.geometric);
        (1.0 - GEOMETRIC_SHARE) * scattered + GEOMETRIC_SHARE * geometric
    }
}

impl FarLight {
    fn of(light: usize, emitter: &Light, scale: f64) -> Option<Self> {
        let (solid_angle, dir, sin) = match emitter.shape {
            LightShape::Sun { frame, one_minus_cos: m } => {
                (2.0 * PI * m, Some(frame.z), (m * (2.0 - m)).max(0.0).sqrt())
            }
            LightShape::Map => (PI, None, 1.0),
            LightShape::Distant { towards } => (1.0, Some(towards), 0.0),
            LightShape::Planar { .. }
            | LightShape::Sphere { .. }
            | LightShape::Point { .. }
            | LightShape::Projector { .. } => return None,
        };
        let irradiance = f64::from(math::luminance(emitter.radiance)) * f64::from(solid_angle) * scale;
        Some(Self { light, irradiance: irradiance as f32, dir, sin })
    }

    #[inline]
    fn weights(&self, receiver: &Receiver) -> Pmf {
        Pmf { scattered: self.weight(receiver, false), geometric: self.weight(receiver, true) }
    }

    /// Its weight for a receiver: an estimate of the light that the receiver scatters, or one, by geometry.
    /// Zero only if it sends no light to the receiver.
    #[inline]
    fn weight(&self, receiver: &Receiver, geometric: bool) -> f32 {
        let Some(dir) = self.dir else {
            // A lobe reflects all that it receives from a uniform map
            let scattered = self.irradiance * (receiver.diffuse + receiver.glossy / PI);
            return if geometric { 1.0 } else { scattered };
        };
        // The sine of the greatest height above the horizon is at most the sum of both sines
        let cos = dir.dot(receiver.normal) + self.sin;
        if cos <= -1e-4 {
            return 0.0;
        }
        if geometric {
            return 1.0;
        }
        self.irradiance
            * (receiver.diffuse * cos.clamp(0.0, 1.0) + receiver.glossy * receiver.lobe(dir, self.sin))
    }
}

//! Bounds on all that nests: how deep, whether in itself, and how much work it makes.
//!
//! A short file can refer to one thing from many, and to those from many more. Each format keeps what it has
//! read, so that nothing is read twice; what is left is counted here.

use crate::error::{LoadError, Place};
use noisefloor_ptwne::{Facets, Material};
use std::cell::{Cell, RefCell};
use std::collections::HashSet;
use std::fmt;
use std::mem::{Discriminant, discriminant};

/// How deep surfaces, textures and materials may nest.
const MAX_NESTED: u64 = 16;
/// Most steps of a load: pixels that are looked at, corners of shapes, surfaces of mixtures, elements that
/// are searched. Some ten seconds.
const MAX_WORK: u64 = 1 << 32;

/// Steps of the tables of a coat, some twenty milliseconds; and how many times that if its roughness varies.
const COAT: usize = 1 << 22;
const ROUGHNESSES: usize = 25;

/// Index and roughness of a coat, by their bits, and its facets; no roughness if it varies.
type CoatKey = (u32, Option<u32>, Discriminant<Facets>);

/// What is being read, one in another, and what all has cost so far.
#[derive(Debug, Default)]
pub(crate) struct Bounds {
    open: RefCell<Vec<usize>>,
    spent: Cell<u64>,
    coats: RefCell<HashSet<CoatKey>>,
}

impl Bounds {
    /// Begins what has the number `key`, is `called` so and may hold others. [`Self::end`] ends it, unless
    /// this is an error.
    pub(crate) fn begin(
        &self,
        key: usize,
        called: impl fmt::Display,
        place: &Place,
    ) -> Result<(), LoadError> {
        let mut open = self.open.borrow_mut();
        if open.contains(&key) {
            return Err(place.bad(format_args!("{called} refers to itself")));
        }
        place.at_most("nested surfaces and textures", open.len() as u64 + 1, MAX_NESTED)?;
        open.push(key);
        Ok(())
    }

    /// Ends what began last.
    pub(crate) fn end(&self) {
        self.open.borrow_mut().pop();
    }

    /// Counts the tables of a material under a coat, which equal coats share.
    pub(crate) fn coat(
        &self,
        material: &Material,
        (varies, facets): (bool, Facets),
        place: &Place,
    ) -> Result<(), LoadError> {
        let Material::Plastic { ior, roughness, .. } = material else { return Ok(()) };
        let key = (ior.to_bits(), (!varies).then(|| roughness.to_bits()), discriminant(&facets));
        match self.coats.borrow_mut().insert(key) {
            true => self.spend(if varies { ROUGHNESSES * COAT } else { COAT }, place),
            false => Ok(()),
        }
    }

    pub(crate) fn spend(&self, work: usize, place: &Place) -> Result<(), LoadError> {
        self.spent.set(self.spent.get().saturating_add(work as u64));
        place.at_most("steps of reading the scene so far", self.spent.get(), MAX_WORK)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::LoadFault;
    use std::path::Path;

    #[test]
    fn work_is_bounded() {
        let (bounds, place) = (Bounds::default(), Place::file(Path::new("a.xml")));
        bounds.spend(1 << 31, &place).unwrap();
        assert!(matches!(
            bounds.spend(usize::MAX, &place),
            Err(LoadError { fault: LoadFault::TooLarge { .. }, .. })
        ));

        // Any number of equal coats, but not of different ones
        let bounds = Bounds::default();
        let coat = |roughness: f32| {
            let (diffuse, specular) = (noisefloor_ptwne::Texture::Colour([0.5; 3]), [1.0; 3]);
            let material = Material::Plastic { diffuse, specular, ior: 1.5, roughness, nonlinear: false };
            bounds.coat(&material, (false, Facets::default()), &place)
        };
        (0..10_000).try_for_each(|_| coat(0.5)).unwrap();
        let error = (0..10_000).try_for_each(|i| coat(i as f32 * 1e-4));
        assert!(matches!(error, Err(LoadError { fault: LoadFault::TooLarge { .. }, .. })));
    }
}

//! Tests of Mitsuba scenes, one module a subject.

/// What is broken, unsupported or too large, and what is only warned of.
#[cfg(test)]
mod attributes;
mod bad;
/// Includes, parameters, search paths, volumes, and errors and warnings together.
#[cfg(test)]
mod files;
/// Broken files: every flip and cut is an error or a scene, never a panic.
#[cfg(test)]
mod hostile;
/// Lights and surroundings.
#[cfg(test)]
mod lights;
/// Surfaces and textures.
#[cfg(test)]
mod materials;
/// Bump and normal maps.
#[cfg(test)]
mod relief;
/// Roughness by map and direction, and transmission.
#[cfg(test)]
mod roughness;
/// Camera, image size, path length; parameters and references.
#[cfg(test)]
mod setup;
/// Shapes and their fronts.
#[cfg(test)]
mod shapes;
/// The scenes in `../shared`, where they are.
#[cfg(test)]
mod shared;
/// Scenes to write, load and look at.
#[cfg(test)]
mod util;

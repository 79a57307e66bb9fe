//! Pictures for textures and environments.

//! voxel

//! Forward kinematics of a block.

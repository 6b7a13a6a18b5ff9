//! Contacts of the wheels of a block.

//! (chapter opens here)

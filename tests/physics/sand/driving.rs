//! Driving on sand.

//! Balance by output zeroing, path following by passive velocity fields.

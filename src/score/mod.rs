//! Score: a photo is read letter by letter.

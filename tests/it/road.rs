//! Claims about the whole road, from word to verdict.

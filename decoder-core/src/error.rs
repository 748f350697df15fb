//! What a decoder can say about bytes it will not play.

//! The list of entropy stages. Ids, names, features and dispatch come from it: a stage is a line here and a file beside.

/// Hands the list to the macro `$then`: number in a header, variant, type, and name, which is also that of its feature.
macro_rules! for_each_stage {
    ($then:ident) => {
        $then! {
            /// Codes of fixed width.
            0 FixedWidth(crate::entropy::fixed_width::FixedWidth) "fixed-width" [];
            /// Static Huffman codes.
            1 Huffman(crate::entropy::huffman::Huffman<'s>) "huffman" [];
            /// Adaptive Huffman codes.
            2 AdaptiveHuffman(crate::entropy::adaptive_huffman::AdaptiveHuffman<'s>) "adaptive-huffman" [];
        }
    };
}

pub(crate) use for_each_stage;

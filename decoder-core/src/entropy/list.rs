//! The list of entropy stages. Modules, ids, names, features and dispatch come from it: a stage is a line here and a file beside.

/// Hands the list to the macro `$then`. A row has the stage's documentation, its number in a header, its type and the
/// file beside that has it, and its name, which is also that of its feature.
#[macro_export]
macro_rules! for_each_stage {
    ($then:ident) => {
        $then! {
            /// Codes of fixed width.
            0 FixedWidth(fixed_width) "fixed-width" [];
            /// Static Huffman codes.
            1 Huffman(huffman<'s>) "huffman" [];
            /// Adaptive Huffman codes.
            2 AdaptiveHuffman(adaptive_huffman<'s>) "adaptive-huffman" [];
        }
    };
}

pub(crate) use for_each_stage;

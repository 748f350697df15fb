//! What can go wrong before and while an image runs.

use crate::fault::Fault;

/// Why an image, a board or a peripheral was refused, or why a run ended.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The bytes are no ELF file for a 32-bit processor, or it is damaged.
    #[error("not an image for a Cortex-M: {0}; give the ELF file that the linker wrote for the chip")]
    NotElf(#[from] object::Error),
    /// The ELF file is for another processor.
    #[error(
        "not an image for a Cortex-M: its ELF machine number is {machine}, expected 40 (little-endian Arm); build it for \
         a thumbv*-none-eabi target"
    )]
    OtherProcessor {
        /// The machine number in the file's header.
        machine: u16,
    },
    /// A segment's bytes are not all in the file.
    #[error(
        "not an image for a Cortex-M: the segment for {address:#010x} ends after the file; the file was cut off, so \
         build it again"
    )]
    SegmentCutOff {
        /// Where the segment is loaded to.
        address: u32,
    },
    /// Two regions lie in the same 16 MB, which is more than the memory map tells apart.
    #[error(
        "{first} and {second} are both in the 16 MB at {address:#010x}: make one region of them, or leave one out"
    )]
    RegionsOverlap {
        /// Name of one region.
        first: &'static str,
        /// Name of the other region.
        second: &'static str,
        /// First address of the 16 MB.
        address: u32,
    },
    /// The board has no memory for a part of the image.
    #[error(
        "the image has {bytes} bytes at {address:#010x}, where this board has no memory for them: link it for this \
         board, or give the board a region there"
    )]
    DoesNotFit {
        /// Where the part is loaded to.
        address: u32,
        /// Bytes of the part.
        bytes: usize,
    },
    /// The board has no memory where the vector table should be.
    #[error(
        "{board} has no memory at {address:#010x}, where the image's vectors are: correct `Board::vectors`, or give the \
         image a symbol `__vector_table`"
    )]
    NoVectors {
        /// Name of the board.
        board: &'static str,
        /// Address of the vector table.
        address: u32,
    },
    /// A peripheral's registers would lie where something else is.
    #[error(
        "a peripheral with {bytes} bytes of registers at {address:#010x} would lie over {other}: attach it elsewhere"
    )]
    PeripheralOverlaps {
        /// First register.
        address: u32,
        /// Bytes of registers.
        bytes: u32,
        /// What is there.
        other: &'static str,
    },
    /// A peripheral's interrupt is not one that the controller has.
    #[error(
        "a peripheral at {address:#010x} was given {lines} interrupt lines, the highest number {highest}: give at most 32 \
         lines, with numbers from 0 to 239"
    )]
    NoSuchInterrupt {
        /// First register.
        address: u32,
        /// How many lines it was given.
        lines: usize,
        /// The highest interrupt number.
        highest: u16,
    },
    /// The simulated core cannot go on.
    #[error("{0}")]
    Fault(#[from] Box<Fault>),
}

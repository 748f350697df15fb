//! The snippets of rules.in, each between the labels `begin_NAME` and `end_NAME`. The host runs them; they have no
//! beginning of their own.
#![no_std]
#![no_main]

use core::arch::global_asm;
use core::panic::PanicInfo;

#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    loop {}
}

global_asm!(
    ".section .vectors, \"a\"",
    ".word _stack_start",
    ".word start",
    ".text",
    ".global start",
    ".type start, %function",
    ".thumb_func",
    "start:",
    "b start",
);

macro_rules! rules {
    ($($group:ident { $($name:ident: $($line:literal)+ => $($cycles:literal),+;)+ })+) => {
        $($group! { $($name: $($line)+;)+ })+
    };
}

/// The target of the Cortex-M33 leaves an extension out that the core has.
#[cfg(v8m)]
macro_rules! extension {
    () => {
        ".cpu cortex-m33"
    };
}

#[cfg(not(v8m))]
macro_rules! extension {
    () => {
        ""
    };
}

macro_rules! snippets {
    ($($name:ident: $($line:literal)+;)+) => {
        $(global_asm!(
            extension!(),
            ".text",
            ".balign 4",
            concat!(".global begin_", stringify!($name)),
            concat!(".global end_", stringify!($name)),
            // What comes before is part of what counts: two narrow instructions, aligned.
            "mov r8, r8",
            "mov r8, r8",
            concat!("begin_", stringify!($name), ":"),
            $($line,)+
            concat!("end_", stringify!($name), ":"),
            "mov r8, r8",
            "b .",
            options(raw),
        );)+
    };
}

macro_rules! thumb1 {
    ($($snippets:tt)+) => { snippets! { $($snippets)+ } };
}

#[cfg(not(thumb2))]
macro_rules! thumb2 {
    ($($snippets:tt)+) => {};
}

#[cfg(not(dsp))]
macro_rules! dsp {
    ($($snippets:tt)+) => {};
}

#[cfg(thumb2)]
macro_rules! thumb2 {
    ($($snippets:tt)+) => { snippets! { $($snippets)+ } };
}

#[cfg(dsp)]
macro_rules! dsp {
    ($($snippets:tt)+) => { snippets! { $($snippets)+ } };
}

include!("rules.in");

//! Each rule of the timing models gives the cycles that a person counts.
#![allow(clippy::unwrap_used)]

use bunraku_tests::{cargo, require_target};
use std::fs;
use thumb_cycles::{Board, Core, Image, Machine, Stop};

/// A snippet of `tests/calibration/src/rules.in`.
struct Rule {
    name: &'static str,
    code: &'static [&'static str],
    cycles: &'static [u32],
}

macro_rules! rules {
    ($($group:ident { $($name:ident: $($line:literal)+ => $($cycles:literal),+;)+ })+) => {
        $(#[allow(non_upper_case_globals)]
        const $group: &[Rule] = &[
            $(Rule { name: stringify!($name), code: &[$($line),+], cycles: &[$($cycles),+] },)+
        ];)+
    };
}

include!("../calibration/src/rules.in");

/// Checks a group of rules on a core; `column` is the core's in the group.
fn check(core: Core, board: &Board, rules: &[Rule], column: usize) -> Vec<String> {
    let path = cargo::image("calibration", "rules", core.target(), "firmware", &[]);
    let image = Image::parse(&fs::read(path).unwrap()).unwrap();
    let ram = board.regions[1].base;
    let measure = |rule: &Rule| {
        let symbol = |end: &str| image.symbol(&format!("{end}_{}", rule.name)).unwrap() & !1;
        let (begin, end) = (symbol("begin"), symbol("end"));
        let mut machine = Machine::new(core, board, &image).unwrap();
        for (register, value) in
            [(2, 4), (3, 7), (4, ram + 0x100), (5, ram + 0x200), (6, ram + 0x300), (7, ram + 0x400)]
        {
            machine.cpu.r[register] = value;
        }
        assert!(machine.memory_mut().program(ram + 0x100, &(ram + 0x500).to_le_bytes()));
        machine.set_breakpoint(begin);
        machine.set_breakpoint(end);
        machine.cpu.pc = begin - 4;
        assert_eq!(machine.run_until(1000).unwrap(), Stop::Breakpoint(begin));
        let before = machine.usage().cycles;
        assert_eq!(machine.run_until(1000).unwrap(), Stop::Breakpoint(end), "{}", rule.name);
        machine.usage().cycles - before
    };
    let mut wrong = Vec::new();
    for rule in rules {
        let (measured, counted) = (measure(rule), u64::from(rule.cycles[column]));
        println!("{:28} {:30} counted {counted:3}, simulated {measured:3}", core.name(), rule.name);
        if measured != counted {
            let code = rule.code.join("; ");
            wrong.push(format!(
                "{} {}: {code}: counted {counted}, simulated {measured}",
                core.name(),
                rule.name
            ));
        }
    }
    wrong
}

#[test]
fn every_rule_gives_the_hand_count() {
    let cores = [
        (Core::M0, Board::microbit(), [Some(0), None, None]),
        (Core::M0Plus, Board::microbit(), [Some(1), None, None]),
        (Core::M0PlusSlow, Board::microbit(), [Some(2), None, None]),
        (Core::M3, Board::mps2(), [Some(3), Some(0), None]),
        (Core::M4, Board::mps2(), [Some(4), Some(1), Some(0)]),
        (Core::M33, Board::mps2_an505(), [Some(5), Some(2), Some(1)]),
    ];
    let mut wrong = Vec::new();
    for (core, board, columns) in cores {
        if !require_target(core.target()) {
            continue;
        }
        for (rules, column) in [thumb1, thumb2, dsp].into_iter().zip(columns) {
            wrong.extend(column.map(|column| check(core, &board, rules, column)).unwrap_or_default());
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

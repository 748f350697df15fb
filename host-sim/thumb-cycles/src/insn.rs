//! A decoded instruction: what it does, on which registers, and what the timing models want to know of it.
//!
//! Decoding happens once for each address, so this is laid out for the execution loop: 28 bytes, nothing left to
//! extract.

/// Which instructions a core has.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Arch {
    /// ARMv6-M (Arm DDI 0419): M0, M0+.
    V6M,
    /// ARMv7-M (Arm DDI 0403) without the DSP extension: M3.
    V7M,
    /// ARMv7E-M: M4, M7.
    V7EM,
    /// ARMv8-M mainline (Arm DDI 0553) with the DSP extension: M33.
    V8M,
}

/// What an instruction does. Operands are in [`Insn`]; names are those of the Arm manuals.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
#[allow(missing_docs)]
pub enum Op {
    /// Not decoded yet.
    Undecoded,
    /// Not an instruction of this core.
    Undefined,
    /// A coprocessor or FPU instruction.
    Coprocessor,
    /// A breakpoint that the host has put here; the instruction is elsewhere.
    HostBreakpoint,

    // Second operand by `src`.
    And,
    Bic,
    Orr,
    Orn,
    Eor,
    Add,
    Adc,
    Sub,
    Sbc,
    Rsb,
    Mov,
    Mvn,
    Tst,
    Teq,
    Cmp,
    Cmn,

    LslReg,
    LsrReg,
    AsrReg,
    RorReg,
    Movt,
    /// `imm` is the mask of the field, `amount` its lowest bit; `n` = 15 clears.
    Bfi,
    /// `amount` is the lowest bit, `imm` the width.
    Sbfx,
    Ubfx,
    /// `imm` is the number of bits to saturate to.
    Ssat,
    Usat,
    Ssat16,
    Usat16,
    Clz,
    Rbit,
    Rev,
    Rev16,
    Revsh,
    /// Extends after a rotation by `amount`; adds `n` unless it is 15.
    Sxtb,
    Sxth,
    Uxtb,
    Uxth,
    Sxtb16,
    Uxtb16,

    Mul,
    Mla,
    Mls,
    /// `a` is the high, `d` the low half.
    Umull,
    Smull,
    Umlal,
    Smlal,
    Umaal,
    Sdiv,
    Udiv,

    /// `imm` bit 1: top half of n; bit 0: top half of m. `a` = 15: nothing is added.
    Smlaxy,
    /// `imm` bit 0: top half of m.
    Smlaw,
    /// `imm` bit 0: swap the halves of m.
    Smlad,
    Smlsd,
    /// `imm` bit 0: round.
    Smmla,
    Smmls,
    Smlalxy,
    Smlald,
    Smlsld,
    Usada8,
    /// `imm` 0: bottom of n with top of shifted m; 1: the reverse.
    Pkh,
    /// `imm`: which of the 36 (operation * 8 + kind), see execute.
    Parallel,
    Qadd,
    Qsub,
    Qdadd,
    Qdsub,
    Sel,

    // Memory; the address by `index`.
    Ldr,
    Ldrb,
    Ldrh,
    Ldrsb,
    Ldrsh,
    LdrPc,
    Str,
    Strb,
    Strh,
    /// Second register in `a`.
    Ldrd,
    Strd,
    /// `imm`: the registers; `amount` 1: descending; `s`: write back.
    Ldm,
    Stm,
    /// `amount`: bytes; `d` for STREX is the status, `a` the value. With `s`, exclusive; `imm` is the offset.
    LoadAcquire,
    StoreRelease,
    Clrex,
    Tbb,
    Tbh,

    /// To `imm`.
    B,
    Bl,
    Bx,
    BlxReg,
    Cbz,
    Cbnz,
    AddPc,
    MovPc,

    Nop,
    It,
    Wfe,
    Wfi,
    Sev,
    Cps,
    Mrs,
    Msr,
    Barrier,
    Svc,
    Bkpt,
    /// TT: answers that there is no protection unit.
    Tt,
}

/// Second operand of a data processing instruction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Src {
    /// `imm`; the carry stays.
    Imm,
    /// `imm`, a rotated constant; the carry is its bit 31.
    ImmRotated,
    /// Register `m`.
    Reg,
    /// Register `m`, shifted by `amount`.
    Shifted,
}

/// How `amount` shifts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
#[allow(missing_docs)]
pub enum Shift {
    Lsl,
    Lsr,
    Asr,
    Ror,
    Rrx,
}

/// How an address is made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Index {
    /// `n + imm`.
    Offset,
    /// `n + imm`, kept in n.
    Pre,
    /// `n`, which becomes `n + imm`.
    Post,
    /// `n + (m << amount)`.
    Register,
    /// `imm`.
    Literal,
}

/// What the timing models tell apart. From [`Class::Call`] on, the call stack may change.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Class {
    /// One cycle in the ALU.
    Alu,
    /// An ALU instruction with a shifted register or a shifted constant as second operand.
    Shifted,
    /// 32-bit multiply.
    Multiply,
    /// 32-bit multiply and accumulate, and the extends that add.
    MultiplyAccumulate,
    /// 64-bit product.
    MultiplyLong,
    /// 64-bit multiply and accumulate.
    MultiplyAccumulateLong,
    /// SDIV, UDIV.
    Divide,
    /// One register.
    Load,
    /// One register.
    Store,
    /// Two registers.
    LoadDouble,
    /// Two registers.
    StoreDouble,
    /// LDM, POP.
    LoadMultiple,
    /// STM, PUSH.
    StoreMultiple,
    /// IT.
    It,
    /// NOP and the hints that do nothing.
    Nop,
    /// DMB, DSB, ISB.
    Barrier,
    /// MRS, MSR.
    Status,
    /// CPS, SEV, CLREX.
    Control,
    /// WFI, WFE.
    Wait,
    /// SVC, BKPT.
    Trap,
    /// B, conditional or not, CBZ, CBNZ.
    Branch,
    /// TBB, TBH.
    TableBranch,
    /// BL.
    Call,
    /// BLX to a register.
    CallRegister,
    /// BX, and instructions that write the pc.
    BranchRegister,
}

/// Condition "always".
pub const ALWAYS: u8 = 14;

/// A decoded instruction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Insn {
    /// What it does.
    pub op: Op,
    /// For the timing models.
    pub class: Class,
    /// Condition, 0 to 14 ([`ALWAYS`]).
    pub cond: u8,
    /// Bytes: 2 or 4; 0 while it is not decoded.
    pub len: u8,
    /// Destination, 0 to 15.
    pub d: u8,
    /// First operand or base.
    pub n: u8,
    /// Second operand or index.
    pub m: u8,
    /// Accumulator, second transfer register.
    pub a: u8,
    /// Constant, offset, target or mask.
    pub imm: u32,
    /// Second operand.
    pub src: Src,
    /// How `amount` shifts.
    pub shift: Shift,
    /// Shift distance.
    pub amount: u8,
    /// Address.
    pub index: Index,
    /// Sets the flags, or writes back.
    pub s: bool,
    /// Registers that it reads, a bit each.
    pub reads: u16,
    /// Registers that it writes, a bit each.
    pub writes: u16,
    /// Registers that its address is made of, a bit each.
    pub address: u16,
    /// The base register that a load or store changes, as a bit; 0 where it changes none.
    pub base: u16,
}

impl Insn {
    /// What is at an address that was never executed.
    pub const UNDECODED: Self = Self::new(Op::Undecoded, Class::Control, 0);

    /// An instruction without operands.
    pub const fn new(op: Op, class: Class, len: u8) -> Self {
        Self {
            op,
            class,
            cond: ALWAYS,
            len,
            d: 15,
            n: 15,
            m: 15,
            a: 15,
            imm: 0,
            src: Src::Imm,
            shift: Shift::Lsl,
            amount: 0,
            index: Index::Offset,
            s: false,
            reads: 0,
            writes: 0,
            address: 0,
            base: 0,
        }
    }

    /// Whether it is a load or store that changes its base register.
    pub fn writes_back(&self) -> bool {
        match self.op {
            Op::Ldm | Op::Stm => self.s,
            _ => matches!(self.index, Index::Pre | Index::Post),
        }
    }

    /// How many registers a load or store transfers.
    pub fn transfers(&self) -> u32 {
        match self.op {
            Op::Ldm | Op::Stm => self.imm.count_ones(),
            Op::Ldrd | Op::Strd => 2,
            _ => 1,
        }
    }

    /// Fills in the register masks from the operands.
    pub fn with_masks(mut self) -> Self {
        let bit = |register: u8| 1u16 << (register & 15);
        let (mut reads, mut writes, mut address) = (0, 0, 0);
        // What the register fields mean by operation.
        match self.op {
            Op::Ldm | Op::Stm => {
                address = bit(self.n);
                let list = self.imm as u16;
                if self.op == Op::Ldm {
                    writes |= list;
                } else {
                    reads |= list;
                }
                if self.s {
                    writes |= bit(self.n);
                }
            }
            Op::Ldr
            | Op::Ldrb
            | Op::Ldrh
            | Op::Ldrsb
            | Op::Ldrsh
            | Op::LdrPc
            | Op::Ldrd
            | Op::LoadAcquire => {
                writes = bit(self.d);
                if self.op == Op::Ldrd {
                    writes |= bit(self.a);
                }
                address = self.address_registers();
            }
            Op::Str | Op::Strb | Op::Strh | Op::Strd => {
                reads = bit(self.d);
                if self.op == Op::Strd {
                    reads |= bit(self.a);
                }
                address = self.address_registers();
            }
            Op::StoreRelease => {
                reads = bit(self.a);
                writes = if self.s { bit(self.d) } else { 0 };
                address = bit(self.n);
            }
            Op::Tbb | Op::Tbh => {
                address = bit(self.n) | bit(self.m);
                writes = bit(15);
            }
            Op::Tst | Op::Teq | Op::Cmp | Op::Cmn => reads = self.operands(),
            Op::Cbz | Op::Cbnz => reads = bit(self.n),
            Op::Msr => reads = bit(self.n),
            Op::Mrs => writes = bit(self.d),
            Op::B => writes = bit(15),
            Op::Bl => writes = bit(15) | bit(14),
            Op::Bx | Op::MovPc | Op::AddPc => {
                reads = bit(self.m);
                writes = bit(15);
            }
            Op::BlxReg => {
                reads = bit(self.m);
                writes = bit(15) | bit(14);
            }
            Op::Movt | Op::Bfi => {
                reads = bit(self.n) | bit(self.d);
                writes = bit(self.d);
            }
            Op::Umull | Op::Smull => {
                reads = bit(self.n) | bit(self.m);
                writes = bit(self.d) | bit(self.a);
            }
            Op::Umlal | Op::Smlal | Op::Umaal | Op::Smlalxy | Op::Smlald | Op::Smlsld => {
                reads = bit(self.n) | bit(self.m) | bit(self.d) | bit(self.a);
                writes = bit(self.d) | bit(self.a);
            }
            Op::Undecoded | Op::Undefined | Op::Coprocessor | Op::HostBreakpoint => {}
            Op::Nop | Op::It | Op::Wfe | Op::Wfi | Op::Sev | Op::Cps | Op::Barrier | Op::Svc | Op::Bkpt => {}
            Op::Clrex => {}
            _ => {
                reads = self.operands();
                writes = bit(self.d);
            }
        }
        if self.writes_back() {
            self.base = bit(self.n);
            writes |= self.base;
        }
        // 15 stands for "none" in the operand fields; the pc is never waited for.
        self.reads = (reads | address) & 0x7fff;
        self.address = address & 0x7fff;
        self.writes = writes;
        self
    }

    fn address_registers(&self) -> u16 {
        match self.index {
            Index::Literal => 0,
            Index::Register => 1 << (self.n & 15) | 1 << (self.m & 15),
            Index::Offset | Index::Pre | Index::Post => 1 << (self.n & 15),
        }
    }

    fn operands(&self) -> u16 {
        1 << (self.n & 15) | 1 << (self.m & 15) | 1 << (self.a & 15)
    }
}

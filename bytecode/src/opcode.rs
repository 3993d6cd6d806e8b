//! The opcode table: every instruction of the virtual machine, declared once.
//!
//! The table is expanded into [`Opcode`], [`Instr`] with its encoder and decoder, the disassembler's text,
//! the verifier's view of operands, and `docs/bytecode.md`. The interpreter has one arm for each row, in the
//! order of the rows (its tests compare the two).
//!
//! An instruction is one 32-bit word, `opcode | operands << 8`, or two: the second, the *aux* word, holds the
//! operand of 32 bits. `R[n]` is a register of the current frame, `K[n]` a constant of the function. Jumps
//! are relative to the word after the instruction. Only the rows under "loops" jump back, and each of them is
//! a tick; so is every call.
//!
//! Numbers are never given twice. 0 and those from `0xC0` on belong to the virtual machine and are refused in
//! files.
//!
//! The word after the mnemonic says how an instruction ends that cannot do its work, and where the value goes
//! that a recovery puts in its place:
//!
//! - `silent`: it never fails. `jump` and `return` are silent instructions that control never passes through:
//!   the code behind them is reached from elsewhere.
//! - `value`: the substitute goes to the first operand, a [`Dst`].
//! - `test`: the substitute is the outcome of the test, which jumps if it holds; `test_not` jumps if it does
//!   not. The last operand is the [`Jump`] or [`Back`].
//! - `effect`: the substitute is dropped.
//! - `call`: the substitutes are delivered as the results of the call; `tail` is a call in place of the
//!   running function, whose results they are then. A [`CallTarget`] names the called function. The operands
//!   begin with `window` and `count`; then comes `want`, unless it is a tail call.
//! - `never`: nothing could stand for its work, so a recovery can only have the instruction tried again, or
//!   leave.
//!
//! After `value`, `test` or `effect` stands the [`Builtin`] that the instruction is, if it is one: applied to
//! the registers that it reads and its integers, in their order, that does the same, failures included.
//!
//! The *slow half* of an instruction is the work that the fast path of its arm leaves over, and that machine
//! code leaves to the machine. After the operands, the row names the function for it, a path below
//! `esl_vm::interp`; [`SlowHalf`] explains the word before the path. A row without one that names a builtin
//! has the builtin as its slow half. Any other row without one has none: its arm is the whole instruction.

use std::fmt;

use crate::builtin::Builtin;
use crate::operand::*;

/// Calls `$with!` with every row of the table.
#[macro_export]
macro_rules! for_each_opcode {
    ($with:ident) => {
        $with! {
            // ---- moves and constants
            /// `R[dst] := R[src]`
            Move = 0x01, "move", silent { dst: Dst, src: Reg };
            /// `R[dst] := value`
            LoadInt = 0x02, "load-int", silent { dst: Dst, value: Int16 };
            /// `R[dst] := K[constant]`
            LoadConst = 0x03, "load-const", silent { dst: Dst, constant: ConstIdx };
            /// `R[first], … R[first+count-1] := NIL`
            LoadNil = 0x04, "load-nil", silent { first: Room, count: Count };
            /// `R[dst] := T`
            LoadTrue = 0x05, "load-true", silent { dst: Dst };

            // ---- arithmetic
            /// `R[dst] := R[left] + R[right]`
            Add = 0x08, "add", value Add { dst: Dst, left: Reg, right: Reg }, first double::mixed_add;
            /// `R[dst] := R[left] - R[right]`
            Sub = 0x09, "sub", value Subtract
                { dst: Dst, left: Reg, right: Reg }, first double::mixed_subtract;
            /// `R[dst] := R[left] * R[right]`
            Mul = 0x0A, "mul", value Multiply
                { dst: Dst, left: Reg, right: Reg }, first double::mixed_multiply;
            /// `R[dst] := R[left] / R[right]`
            Div = 0x0B, "div", value Divide { dst: Dst, left: Reg, right: Reg }, first double::mixed_divide;
            /// `R[dst] := R[left] + value`
            AddInt = 0x0C, "add-int", value Add { dst: Dst, left: Reg, value: Int8 };
            /// `R[dst]` := the quotient of `R[left]` by `R[right]`, rounded towards minus infinity
            Floor = 0x0D, "floor", value Floor { dst: Dst, left: Reg, right: Reg };
            /// `R[dst]` := the quotient of `R[left]` by `R[right]`, rounded towards zero
            Truncate = 0x0E, "truncate", value Truncate { dst: Dst, left: Reg, right: Reg };
            /// `R[dst]` := the remainder that goes with `floor`
            Mod = 0x0F, "mod", value Mod { dst: Dst, left: Reg, right: Reg };
            /// `R[dst]` := the remainder that goes with `truncate`
            Rem = 0x10, "rem", value Rem { dst: Dst, left: Reg, right: Reg };
            /// `R[dst] := R[left] and R[right]`, bit by bit
            LogAnd = 0x11, "logand", value LogAnd { dst: Dst, left: Reg, right: Reg };
            /// `R[dst] := R[left] or R[right]`, bit by bit
            LogIor = 0x12, "logior", value LogIor { dst: Dst, left: Reg, right: Reg };
            /// `R[dst] := R[left] xor R[right]`, bit by bit
            LogXor = 0x13, "logxor", value LogXor { dst: Dst, left: Reg, right: Reg };
            /// `R[dst]` := integer `R[left]` shifted left by `R[right]`, right when that is negative
            Ash = 0x14, "ash", value Ash { dst: Dst, left: Reg, right: Reg };

            // ---- comparisons that give T or NIL
            /// `R[dst] := (not R[src])`
            Not = 0x18, "not", silent { dst: Dst, src: Reg };
            /// `R[dst] := (eq R[left] R[right])`
            Eq = 0x19, "eq", silent { dst: Dst, left: Reg, right: Reg };
            /// `R[dst] := (eql R[left] R[right])`
            Eql = 0x1A, "eql", silent { dst: Dst, left: Reg, right: Reg }, gives cold::eql;
            /// `R[dst] := (= R[left] R[right])`
            NumEq = 0x1B, "num-eq", value NumEqual { dst: Dst, left: Reg, right: Reg };
            /// `R[dst] := (< R[left] R[right])`
            Less = 0x1C, "less", value Less { dst: Dst, left: Reg, right: Reg };
            /// `R[dst] := (<= R[left] R[right])`
            LessEq = 0x1D, "less-eq", value LessEqual { dst: Dst, left: Reg, right: Reg };
            /// `R[dst] := (char= R[left] R[right])`
            CharEq = 0x1F, "char-eq", value CharEqualExactly { dst: Dst, left: Reg, right: Reg };
            /// `R[dst]` := whether `R[src]` is of the type
            IsType = 0x1E, "is-type", silent { dst: Dst, src: Reg, code: TypeIdx }, gives cold::is_type;

            // ---- jumps forward
            /// Jumps.
            JumpAlways = 0x20, "jump", jump { to: Jump24 };
            /// Jumps if `R[test]` is `NIL`.
            JumpIfNil = 0x21, "jump-if-nil", silent { test: Reg, to: Jump16 };
            /// Jumps if `R[test]` is not `NIL`.
            JumpIfNotNil = 0x22, "jump-if-not-nil", silent { test: Reg, to: Jump16 };
            /// Jumps if `R[test]` is a pair.
            JumpIfCons = 0x23, "jump-if-cons", silent { test: Reg, to: Jump16 };
            /// Jumps if `R[test]` is not a pair.
            JumpIfNotCons = 0x24, "jump-if-not-cons", silent { test: Reg, to: Jump16 };
            /// Jumps if an argument was given for the parameter `R[test]`; otherwise the default follows.
            JumpIfSupplied = 0x25, "jump-if-supplied", silent { test: Reg, to: Jump16 };
            /// Jumps if `(eq R[left] R[right])`.
            JumpEq = 0x26, "jump-eq", silent { left: Reg, right: Reg, to: Jump };
            /// Jumps unless `(eq R[left] R[right])`.
            JumpNotEq = 0x27, "jump-not-eq", silent { left: Reg, right: Reg, to: Jump };
            /// Jumps if `(eql R[left] R[right])`.
            JumpEql = 0x28, "jump-eql", silent { left: Reg, right: Reg, to: Jump }, jumps cold::jump_eql;
            /// Jumps unless `(eql R[left] R[right])`.
            JumpNotEql = 0x29, "jump-not-eql", silent
                { left: Reg, right: Reg, to: Jump }, stays cold::jump_eql;
            /// Jumps if `(eql R[left] K[constant])`.
            JumpEqlConst = 0x2A, "jump-eql-const", silent
                { left: Reg, constant: ConstIdx, to: Jump }, jumps cold::jump_eql_const;
            /// Jumps unless `(eql R[left] K[constant])`.
            JumpNotEqlConst = 0x2B, "jump-not-eql-const", silent
                { left: Reg, constant: ConstIdx, to: Jump }, stays cold::jump_eql_const;
            /// Jumps if `R[test]` is of the type.
            JumpIfType = 0x2C, "jump-if-type", silent
                { test: Reg, code: TypeIdx, to: Jump }, jumps cold::jump_if_type;
            /// Jumps unless `R[test]` is of the type.
            JumpIfNotType = 0x2D, "jump-if-not-type", silent
                { test: Reg, code: TypeIdx, to: Jump }, stays cold::jump_if_type;
            /// Jumps if `(= R[left] R[right])`.
            JumpNumEq = 0x30, "jump-num-eq", test NumEqual { left: Reg, right: Reg, to: Jump };
            /// Jumps unless `(= R[left] R[right])`.
            JumpNotNumEq = 0x31, "jump-not-num-eq", test_not NumEqual { left: Reg, right: Reg, to: Jump };
            /// Jumps if `(< R[left] R[right])`.
            JumpLess = 0x32, "jump-less", test Less { left: Reg, right: Reg, to: Jump };
            /// Jumps unless `(< R[left] R[right])`.
            JumpNotLess = 0x33, "jump-not-less", test_not Less { left: Reg, right: Reg, to: Jump };
            /// Jumps if `(<= R[left] R[right])`.
            JumpLessEq = 0x34, "jump-less-eq", test LessEqual { left: Reg, right: Reg, to: Jump };
            /// Jumps unless `(<= R[left] R[right])`.
            JumpNotLessEq = 0x35, "jump-not-less-eq", test_not LessEqual { left: Reg, right: Reg, to: Jump };
            /// Jumps if `(= R[left] value)`.
            JumpNumEqInt = 0x36, "jump-num-eq-int", test NumEqual { left: Reg, value: Int16, to: Jump };
            /// Jumps unless `(= R[left] value)`.
            JumpNotNumEqInt = 0x37, "jump-not-num-eq-int", test_not NumEqual
                { left: Reg, value: Int16, to: Jump };
            /// Jumps if `(< R[left] value)`.
            JumpLessInt = 0x38, "jump-less-int", test Less { left: Reg, value: Int16, to: Jump };
            /// Jumps unless `(< R[left] value)`.
            JumpNotLessInt = 0x39, "jump-not-less-int", test_not Less { left: Reg, value: Int16, to: Jump };
            /// Jumps if `(> R[left] value)`.
            JumpGreaterInt = 0x3A, "jump-greater-int", test Greater { left: Reg, value: Int16, to: Jump };
            /// Jumps unless `(> R[left] value)`.
            JumpNotGreaterInt = 0x3B, "jump-not-greater-int", test_not Greater
                { left: Reg, value: Int16, to: Jump };

            // ---- loops: the only jumps back, a tick each
            /// Jumps back.
            Loop = 0x40, "loop", jump { to: Back24 };
            /// Jumps back if `R[test]` is `NIL`.
            LoopIfNil = 0x41, "loop-if-nil", silent { test: Reg, to: Back16 };
            /// Jumps back if `R[test]` is not `NIL`.
            LoopIfNotNil = 0x42, "loop-if-not-nil", silent { test: Reg, to: Back16 };
            /// Jumps back if `R[test]` is a pair.
            LoopIfCons = 0x43, "loop-if-cons", silent { test: Reg, to: Back16 };
            /// Jumps back if `(< R[left] R[right])`.
            LoopLess = 0x44, "loop-less", test Less { left: Reg, right: Reg, to: Back };
            /// Jumps back unless `(< R[left] R[right])`.
            LoopNotLess = 0x45, "loop-not-less", test_not Less { left: Reg, right: Reg, to: Back };
            /// `R[counter] := R[counter] + step`, then jumps back if `(< R[counter] R[limit])`. The addition,
            /// and with it the instruction, has no effect unless both are real numbers.
            LoopCount = 0x46, "loop-count", test
                { counter: Reg, limit: Reg, step: Int8, to: Back }, test cold::loop_count;

            // ---- lists
            /// `R[dst] := (cons R[car] R[cdr])`
            Cons = 0x48, "cons", value Cons { dst: Dst, car: Reg, cdr: Reg };
            /// `R[dst] := (car R[list])`
            Car = 0x49, "car", value Car { dst: Dst, list: Reg };
            /// `R[dst] := (cdr R[list])`
            Cdr = 0x4A, "cdr", value Cdr { dst: Dst, list: Reg };
            /// `R[dst] := (cadr R[list])`
            Cadr = 0x4B, "cadr", value Cadr { dst: Dst, list: Reg };
            /// `R[dst] := (cddr R[list])`
            Cddr = 0x4C, "cddr", value Cddr { dst: Dst, list: Reg };
            /// The car of the pair `R[pair]` becomes `R[value]`.
            SetCar = 0x4D, "set-car", effect SetCar { pair: Reg, value: Reg };
            /// The cdr of the pair `R[pair]` becomes `R[value]`.
            SetCdr = 0x4E, "set-cdr", effect SetCdr { pair: Reg, value: Reg };
            /// `R[dst]` := a fresh list of `R[first], … R[first+count-1]`
            List = 0x4F, "list", value { dst: Dst, first: Items, count: Count }, does cold::list;

            // ---- vectors and structures
            /// `R[dst] := (svref R[vector] R[index])`
            VectorRef = 0x50, "vector-ref", value Svref { dst: Dst, vector: Reg, index: Reg };
            /// `R[dst] := (aref R[array] R[index])`, for an array of rank 1
            ArrayRef = 0x52, "array-ref", value Aref { dst: Dst, array: Reg, index: Reg };
            /// Element `R[index]` of the simple vector `R[vector]` becomes `R[value]`.
            VectorSet = 0x51, "vector-set", effect SetSvref { vector: Reg, index: Reg, value: Reg };
            /// Element `R[index]` of the array `R[array]` of rank 1 becomes `R[value]`.
            ArraySet = 0x53, "array-set", effect SetAref { array: Reg, index: Reg, value: Reg };
            /// `R[dst] := (svref R[vector] index)`
            VectorRefInt = 0x66, "vector-ref-int", value Svref { dst: Dst, vector: Reg, index: Index };
            /// Element `index` of the simple vector `R[vector]` becomes `R[value]`.
            VectorSetInt = 0x67, "vector-set-int", effect SetSvref { vector: Reg, index: Index, value: Reg };
            /// `R[dst] := (char R[string] R[index])`
            CharRef = 0x57, "char-ref", value Char { dst: Dst, string: Reg, index: Reg };
            /// `R[dst]` := slot `slot` of `R[instance]`, which must be an instance of the class or a
            /// subclass.
            Slot = 0x54, "slot", value
                { dst: Dst, instance: Reg, slot: Index, class: WideClassIdx }, rest cold::slot;
            /// Slot `slot` of `R[instance]` becomes `R[value]`.
            SetSlot = 0x55, "set-slot", effect
                { instance: Reg, slot: Index, value: Reg, class: WideClassIdx }, rest cold::set_slot;
            /// Jumps unless `R[test]` is an instance of the class or a subclass.
            JumpIfNotInstance = 0x56, "jump-if-not-instance", silent
                { test: Reg, class: ClassIdx, to: Jump }, stays cold::jump_if_instance;

            // ---- variables
            /// `R[dst]` := a fresh box that holds `R[src]`
            MakeBox = 0x58, "make-box", never { dst: Dst, src: Reg }, does cold::make_box;
            /// `R[dst]` := the value in the box `R[cell]`. The box must have been made by `make-box`.
            BoxRef = 0x59, "box-ref", silent { dst: Dst, cell: Reg };
            /// The box `R[cell]` holds `R[src]`.
            BoxSet = 0x5A, "box-set", silent { cell: Reg, src: Reg };
            /// `R[dst]` := a closure of `K[function]`, whose captures are taken as that function declares
            /// them
            MakeClosure = 0x5B, "make-closure", never
                { dst: Dst, function: FunctionIdx }, rest cold::make_closure;
            /// Capture `index` of the closure `R[closure]`, made by `make-closure` in this frame, becomes
            /// `R[src]`. The closure's function declares that capture as one that comes later.
            PatchCapture = 0x5C, "patch-capture", silent { closure: Reg, index: Index, src: Reg };
            /// `R[dst]` := capture `index` of the running function
            CaptureRef = 0x5D, "capture-ref", silent { dst: Dst, index: Index };
            /// `R[dst]` := the value in the box that is capture `index` of the running function
            CaptureBoxRef = 0x5E, "capture-box-ref", silent { dst: Dst, index: Index };
            /// The box that is capture `index` of the running function holds `R[src]`.
            CaptureBoxSet = 0x5F, "capture-box-set", silent { src: Reg, index: Index };
            /// `R[dst]` := the value of the special variable `K[symbol]`
            SymbolValue = 0x60, "symbol-value", value
                { dst: Dst, symbol: SymbolIdx }, rest variable::symbol_value;
            /// The special variable `K[symbol]` becomes `R[src]`.
            SetSymbolValue = 0x61, "set-symbol-value", effect
                { src: Reg, symbol: SymbolIdx }, rest variable::set_symbol_value;
            /// Binds the special variable `K[symbol]` to `R[src]`.
            Bind = 0x62, "bind", never { src: Reg, symbol: SymbolIdx }, does variable::bind;
            /// Undoes the newest `count` bindings of this frame.
            Unbind = 0x63, "unbind", silent { count: Count }, does variable::unbind;
            /// Binds the symbols of the list `R[symbols]` to the items of `R[values]`, missing ones to
            /// nothing. The innermost control entry must be a scope of this frame; popping it undoes the
            /// bindings.
            BindList = 0x64, "bind-list", effect { symbols: Reg, values: Reg }, does unwind::bind_list;
            /// `R[dst]` := the global function named `K[symbol]`
            FunctionRef = 0x65, "function-ref", value
                { dst: Dst, symbol: SymbolIdx }, does variable::function_ref;

            // ---- calls: a window is the callee (or room for it), a link word, then the arguments
            /// Calls the function (or function named by the symbol) `R[window]` with `R[window+2] …`.
            Call = 0x68, "call", call Given { window: Window, count: Count, want: Want, pad: Pad };
            /// Calls the global function `K[symbol]` with `R[window+2] …`.
            CallGlobal = 0x69, "call-global", call Global
                { window: Window, count: Count, want: Want, symbol: WideSymbolIdx };
            /// Calls the running function, with the number of arguments that it takes exactly.
            CallSelf = 0x6A, "call-self", call Running { window: Window, count: Count, want: Want, pad: Pad };
            /// Calls a builtin with `R[window+2] …`.
            CallBuiltin = 0x6B, "call-builtin", call Builtin
                { window: Window, count: Count, want: Want, builtin: BuiltinIdx };
            /// Calls `R[window]` with `R[window+2] …`, the last argument a list of further arguments.
            Apply = 0x6C, "apply", call Applied { window: Window, count: Count, want: Want, pad: Pad };
            /// As `apply`, in place of the running function.
            TailApply = 0x70, "tail-apply", tail Applied { window: Window, count: Count, pad: Pad };
            /// As `call`, in place of the running function.
            TailCall = 0x6D, "tail-call", tail Given { window: Window, count: Count, pad: Pad };
            /// As `call-global`, in place of the running function.
            TailCallGlobal = 0x6E, "tail-call-global", tail Global
                { window: Window, count: Count, symbol: WideSymbolIdx };
            /// As `call-builtin`; returns the values of the builtin.
            TailCallBuiltin = 0x6F, "tail-call-builtin", tail Builtin
                { window: Window, count: Count, builtin: BuiltinIdx };
            /// Returns `R[src]`.
            Return = 0x71, "return", return { src: Reg };
            /// Returns `R[first], … R[first+count-1]` as multiple values.
            ReturnValues = 0x72, "return-values", return
                { first: Items, count: Count }, quiet cold::set_values;
            /// Returns the value list.
            ReturnAll = 0x73, "return-all", return {};

            // ---- the value list: where all values of a form are kept
            /// The value list := `R[first], … R[first+count-1]`
            SetValues = 0x74, "set-values", silent { first: Items, count: Count }, does cold::set_values;
            /// `R[first], … R[first+count-1]` := the value list, missing values `NIL`
            GetValues = 0x75, "get-values", silent { first: Room, count: Count }, does cold::get_values;
            /// `R[dst]` := a fresh list of the value list
            ValuesToList = 0x76, "values-to-list", value { dst: Dst }, does cold::values_to_list;
            /// The value list := the items of the list `R[src]`
            ListToValues = 0x77, "list-to-values", effect { src: Reg }, does cold::list_to_values;

            // ---- the control stack. While an entry stands, registers below its `window` keep their values.
            /// `R[dst]` := a fresh tag, equal only to itself, for `push-catch`
            NewTag = 0x78, "new-tag", value { dst: Dst }, does unwind::new_tag;
            /// Pushes a catch for the tag `R[tag]`: a throw to it pops it, delivers its values to the window,
            /// and goes on at `to`.
            PushCatch = 0x79, "push-catch", never
                { window: Window, tag: Reg, want: Want, to: Landing }, does unwind::push_catch;
            /// Pushes a cleanup: when an unwinding passes, the code at `to` runs until `end-cleanup`.
            PushCleanup = 0x7A, "push-cleanup", never
                { window: Window, to: Landing }, does unwind::push_cleanup;
            /// Pushes handlers: for each type of the vector `K[types]`, a case. When one takes a condition,
            /// the entry is popped, `R[window]` is the index of the case, `R[window+1]` the condition, and
            /// control goes to `to`.
            PushHandlerCase = 0x7B, "push-handler-case", never
                { window: Window, types: VectorIdx, to: Landing }, does unwind::push_handler_case;
            /// Pushes recovery procedures. `R[state]` is their table, a vector, or the state that the machine
            /// has made of it. A throw to `R[state]` pops them, delivers two values to the window, and goes
            /// on at `to`, where the function that runs the clauses is made: the machine makes it there when
            /// a failure needs it first.
            PushRecovery = 0x84, "push-recovery", never
                { window: Window, state: Reg, to: Landing }, does unwind::push_recovery;
            /// Pushes a cleanup for failures: when a failure, an abort or an expired limit leaves, the code
            /// at `to` runs until `end-cleanup`. After a failure the value list is then that failure and the
            /// data about it.
            PushFailureCleanup = 0x85, "push-failure-cleanup", never
                { window: Window, to: Landing }, does unwind::push_failure_cleanup;
            /// Pushes handlers that run at the point of signalling: `R[handlers]` is a list of `(type .
            /// function)`.
            PushHandlers = 0x7C, "push-handlers", never
                { window: Window, handlers: Reg }, does unwind::push_handlers;
            /// Pushes a mask: entries from the fixnum `R[from]` on (a height of the control stack) are not
            /// searched.
            PushMask = 0x7D, "push-mask", never { window: Window, from: Reg }, does unwind::push_mask;
            /// Pushes a scope for `bind-list`.
            PushScope = 0x7E, "push-scope", never { window: Window }, does unwind::push_scope;
            /// Pops the newest `count` entries, and undoes bindings made since the oldest of them.
            PopControl = 0x7F, "pop-control", silent { count: Count }, does unwind::pop;
            /// Ends the protected part in the normal way: the cleanup entry on top becomes a running cleanup,
            /// and control falls through into its code. The value list is kept until `end-cleanup`.
            EnterCleanup = 0x80, "enter-cleanup", silent {}, does unwind::enter_cleanup;
            /// Ends a cleanup: continues the unwinding that it interrupted, or goes on with the next
            /// instruction after `enter-cleanup`.
            EndCleanup = 0x81, "end-cleanup", silent {}, does unwind::end_cleanup;
            /// Throws the value list to the catch for the tag `R[tag]`. Fails with `control-error`, nothing
            /// unwound, when there is none; `kind` says which form it was: 0 `throw`, 1 `return-from`, 2
            /// `go`. Then the value list is that of a recovery.
            Throw = 0x82, "throw", effect { tag: Reg, kind: ThrowKind };

            // ---- counting
            /// Counts that control passes the place with this number, if the machine is asked to. Not a tick.
            Pass = 0x86, "pass", silent { place: PassIdx }, quiet cold::pass;

            // ---- exploring
            /// Stands before an instruction that uses a place which other tasks may reach. If schedules are
            /// explored strictly, the task lets others go first here. Not a tick.
            Point = 0x87, "point", silent {}, does point::point;
        }
    };
}

/// Use of a value that a recovery puts in place of a failed instruction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Substitute {
    /// The instruction never fails.
    Silent,
    /// The value goes to the register that the first operand names.
    Value,
    /// The value decides the test; the instruction jumps if it holds.
    Test,
    /// The value decides the test; the instruction jumps if it does not hold.
    TestNot,
    /// The values are delivered as the results of a call.
    Call,
    /// The values are returned, as those of a tail call.
    Tail,
    /// The value is dropped.
    Effect,
    /// No value can stand for the instruction: it is tried again, or left.
    Never,
}

impl Substitute {
    /// Returns the word for it in the documentation.
    pub const fn word(self) -> &'static str {
        match self {
            Substitute::Silent => "silent",
            Substitute::Value => "value",
            Substitute::Test => "test",
            Substitute::TestNot => "test-not",
            Substitute::Call => "call",
            Substitute::Tail => "tail",
            Substitute::Effect => "effect",
            Substitute::Never => "never",
        }
    }
}

/// The kind of function that does the slow half of an instruction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SlowHalf {
    /// There is no such function: the arm is the whole instruction.
    None,
    /// The builtin that the row names does the work that the fast path of the arm leaves over.
    Builtin,
    /// `first`: as [`SlowHalf::Builtin`], after the function has been tried with the two operands. The
    /// function returns the value, or `UNBOUND` for operands that it leaves to the builtin. It asks for no
    /// safepoint.
    First,
    /// `does`: the function does the whole instruction. It may fail, charge the task and ask for a safepoint.
    Does,
    /// `rest`: as `does`, for the work that the fast path of the arm leaves over.
    Rest,
    /// `quiet`: as `does`, for a function that never fails, charges nothing and asks for nothing. Of a
    /// `return` it does all that comes before the return.
    Quiet,
    /// `gives`: as `quiet`, for a function that returns the value of the first operand.
    Gives,
    /// `jumps`: as `quiet`, for a function that returns whether the instruction jumps.
    Jumps,
    /// `stays`: as `jumps`, for a function that returns whether the instruction does not jump.
    Stays,
    /// `test`: as `rest`, for a function that returns whether a test holds.
    Test,
}

/// Function that an instruction calls.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CallTarget {
    /// The function in the first register of the window, or the one that the symbol there names.
    Given,
    /// The global function that the constant `symbol` names.
    Global,
    /// The running function.
    Running,
    /// The operand `builtin`.
    Builtin,
    /// As [`CallTarget::Given`]; the last argument is a list of further arguments.
    Applied,
}

impl CallTarget {
    /// Returns whether the callee is a value in the first register of the window.
    pub const fn is_in_window(self) -> bool {
        matches!(self, CallTarget::Given | CallTarget::Applied)
    }
}

/// The operands that all calls have in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CallOperands {
    /// Function called.
    pub callee: CallTarget,
    /// First register of the window.
    pub window: Window,
    /// Number of arguments in the window.
    pub count: Count,
    /// How many values are delivered to the window; `None` for a tail call.
    pub want: Option<Want>,
}

macro_rules! substitute {
    (silent) => {
        Substitute::Silent
    };
    (jump) => {
        Substitute::Silent
    };
    (return) => {
        Substitute::Silent
    };
    (value $($builtin:ident)?) => {
        Substitute::Value
    };
    (test $($builtin:ident)?) => {
        Substitute::Test
    };
    (test_not $($builtin:ident)?) => {
        Substitute::TestNot
    };
    (effect $($builtin:ident)?) => {
        Substitute::Effect
    };
    (call $callee:ident) => {
        Substitute::Call
    };
    (tail $callee:ident) => {
        Substitute::Tail
    };
    (never) => {
        Substitute::Never
    };
}

macro_rules! slow_half {
    ([$($kind:ident)+] first) => {
        SlowHalf::First
    };
    ([$($kind:ident)+] does) => {
        SlowHalf::Does
    };
    ([$($kind:ident)+] rest) => {
        SlowHalf::Rest
    };
    ([$($kind:ident)+] quiet) => {
        SlowHalf::Quiet
    };
    ([$($kind:ident)+] gives) => {
        SlowHalf::Gives
    };
    ([$($kind:ident)+] jumps) => {
        SlowHalf::Jumps
    };
    ([$($kind:ident)+] stays) => {
        SlowHalf::Stays
    };
    ([$($kind:ident)+] test) => {
        SlowHalf::Test
    };
    ([$($kind:ident)+]) => {
        if names_builtin(builtin!($($kind)+)) { SlowHalf::Builtin } else { SlowHalf::None }
    };
}

const fn names_builtin(builtin: Option<Builtin>) -> bool {
    builtin.is_some()
}

macro_rules! falls_through {
    (jump) => {
        false
    };
    (return) => {
        false
    };
    (tail $callee:ident) => {
        false
    };
    ($($other:ident)+) => {
        true
    };
}

macro_rules! callee {
    (call $callee:ident) => {
        Some(CallTarget::$callee)
    };
    (tail $callee:ident) => {
        Some(CallTarget::$callee)
    };
    ($($other:ident)+) => {
        None
    };
}

macro_rules! call {
    ($instr:expr, $name:ident call $callee:ident) => {
        match $instr {
            Instr::$name { window, count, want, .. } => {
                Some(CallOperands { callee: CallTarget::$callee, window, count, want: Some(want) })
            }
            _ => None,
        }
    };
    ($instr:expr, $name:ident tail $callee:ident) => {
        match $instr {
            Instr::$name { window, count, .. } => {
                Some(CallOperands { callee: CallTarget::$callee, window, count, want: None })
            }
            _ => None,
        }
    };
    ($instr:expr, $name:ident $($other:ident)+) => {
        None
    };
}

macro_rules! builtin {
    (value $builtin:ident) => {
        Some(Builtin::$builtin)
    };
    (test $builtin:ident) => {
        Some(Builtin::$builtin)
    };
    (test_not $builtin:ident) => {
        Some(Builtin::$builtin)
    };
    (effect $builtin:ident) => {
        Some(Builtin::$builtin)
    };
    ($($other:ident)+) => {
        None
    };
}

/// RegisterAccess of an instruction to consecutive registers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RegisterAccess {
    /// Reads the registers.
    Read {
        /// First register.
        first: u8,
        /// Number of registers.
        count: u8,
    },
    /// Writes the registers.
    Write {
        /// First register.
        first: u8,
        /// Number of registers.
        count: u8,
    },
}

impl Instr {
    /// Calls `visit` with each access to registers that operands name, in the order of the operands. The
    /// accesses of a call to its window are left out.
    pub fn visit_registers(&self, mut visit: impl FnMut(RegisterAccess)) {
        let mut range = None;
        self.visit_operands(|role| match (role, range.take()) {
            (Role::Read(first), _) => visit(RegisterAccess::Read { first, count: 1 }),
            (Role::Write(first), _) => visit(RegisterAccess::Write { first, count: 1 }),
            (Role::Count(count), Some(Role::ReadRange(first))) => {
                visit(RegisterAccess::Read { first, count })
            }
            (Role::Count(count), Some(Role::WriteRange(first))) => {
                visit(RegisterAccess::Write { first, count })
            }
            (role, _) => range = Some(role),
        });
    }
}

/// One row of the table, for tools that list opcodes.
#[derive(Clone, Copy, Debug)]
pub struct OpcodeInfo {
    /// The opcode.
    pub opcode: Opcode,
    /// Name in disassemblies.
    pub mnemonic: &'static str,
    /// Use of a value put in place of the failed instruction.
    pub substitute: Substitute,
    /// Function called; `None` unless it is a call.
    pub callee: Option<CallTarget>,
    /// The builtin that it is, if it is one.
    pub builtin: Option<Builtin>,
    /// The kind of function that does its slow half.
    pub slow_half: SlowHalf,
    /// Name and type of each operand, in order.
    pub operands: &'static [(&'static str, &'static str)],
    /// Effect of the instruction.
    pub doc: &'static [&'static str],
}

macro_rules! define_opcodes {
    ($( $(#[doc = $doc:literal])* $name:ident = $number:literal, $mnemonic:literal, $($kind:ident)+
        { $( $field:ident : $ty:ident ),* } $( , $slow:ident $half:path )? ; )*) => {
        /// The number of an instruction.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[repr(u8)]
        pub enum Opcode {
            $( $(#[doc = $doc])* $name = $number, )*
        }

        /// An instruction, decoded.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[allow(missing_docs, reason = "operands are described by the text of their instruction")]
        pub enum Instr {
            $( $(#[doc = $doc])* $name { $( $field: $ty ),* }, )*
        }

        /// The table as data, in the order of declaration.
        pub const OPCODES: &[OpcodeInfo] = &[
            $( OpcodeInfo {
                opcode: Opcode::$name,
                mnemonic: $mnemonic,
                substitute: substitute!($($kind)+),
                callee: callee!($($kind)+),
                builtin: builtin!($($kind)+),
                slow_half: slow_half!([$($kind)+] $($slow)?),
                operands: &[$( (stringify!($field), stringify!($ty)) ),*],
                doc: &[$( $doc ),*],
            }, )*
        ];

        impl Opcode {
            /// Returns the opcode with this number, unless there is none.
            #[inline(always)]
            pub const fn from_number(number: u8) -> Option<Opcode> {
                match number {
                    $( $number => Some(Opcode::$name), )*
                    _ => None,
                }
            }

            /// Returns the name in disassemblies.
            pub fn mnemonic(self) -> &'static str {
                match self {
                    $( Opcode::$name => $mnemonic, )*
                }
            }

            /// Length of the instruction in words: 1, or 2 with an aux word.
            #[inline(always)]
            pub const fn words(self) -> usize {
                match self {
                    $( Opcode::$name => 1 $( + (<$ty as Operand>::WIDTH == 32) as usize )*, )*
                }
            }

            /// Returns the use of a value put in place of the failed instruction.
            #[inline(always)]
            pub const fn substitute(self) -> Substitute {
                match self {
                    $( Opcode::$name => substitute!($($kind)+), )*
                }
            }

            /// Returns whether control may come to the next instruction from this one.
            pub const fn falls_through(self) -> bool {
                match self {
                    $( Opcode::$name => falls_through!($($kind)+), )*
                }
            }

            /// Returns whether it may jump back, which takes a tick.
            pub const fn is_loop(self) -> bool {
                match self {
                    $( Opcode::$name => false $( || is_back(stringify!($ty)) )*, )*
                }
            }

            /// Returns the function called; `None` unless it is a call.
            #[inline(always)]
            pub const fn callee(self) -> Option<CallTarget> {
                match self {
                    $( Opcode::$name => callee!($($kind)+), )*
                }
            }

            /// Returns the builtin that does the same with the registers that it reads and its integers;
            /// `None` if there is none.
            pub const fn builtin(self) -> Option<Builtin> {
                match self {
                    $( Opcode::$name => builtin!($($kind)+), )*
                }
            }

            /// Returns the kind of function that does its slow half.
            pub const fn slow_half(self) -> SlowHalf {
                match self {
                    $( Opcode::$name => slow_half!([$($kind)+] $($slow)?), )*
                }
            }

            /// Returns whether the function of its slow half does the whole instruction, so that its arm need
            /// not have run.
            pub const fn is_done_by_slow_half(self) -> bool {
                self.falls_through()
                    && matches!(
                        self.slow_half(),
                        SlowHalf::Does | SlowHalf::Quiet | SlowHalf::Gives | SlowHalf::Jumps | SlowHalf::Stays
                    )
            }

            /// Returns whether it is a call in place of the running function.
            pub const fn is_tail(self) -> bool {
                matches!(self.substitute(), Substitute::Tail)
            }

            /// Returns whether a test jumps when it holds.
            pub const fn jumps_when(self) -> bool {
                !matches!(self.substitute(), Substitute::TestNot)
            }
        }

        impl Instr {
            /// Returns the opcode of this instruction.
            pub fn opcode(&self) -> Opcode {
                match self {
                    $( Instr::$name { .. } => Opcode::$name, )*
                }
            }

            /// Returns the operands that all calls have; `None` unless it is a call.
            pub fn call(&self) -> Option<CallOperands> {
                match self {
                    $( Instr::$name { .. } => call!(*self, $name $($kind)+), )*
                }
            }

            /// Returns the instruction word, and the aux word if it has one.
            pub fn encode(&self) -> (u32, Option<u32>) {
                match *self {
                    $( Instr::$name { $( $field ),* } => {
                        #[allow(unused_mut, reason = "some instructions have no operands")]
                        let mut packer = Packer::new(Opcode::$name);
                        $( packer.put($field); )*
                        packer.finish()
                    } )*
                }
            }

            /// Decodes the instruction that begins at `code[at]`. `None` if there is no such opcode or the
            /// aux word is missing.
            pub fn decode(code: &[u32], at: usize) -> Option<Instr> {
                let word = *code.get(at)?;
                let opcode = Opcode::from_number(word as u8)?;
                let aux = if opcode.words() == 2 { *code.get(at + 1)? } else { 0 };
                Some(Instr::from_words(opcode, word, aux))
            }

            /// Decodes the operands of an instruction with this opcode; `aux` is of no matter if it has one
            /// word.
            #[inline(always)]
            pub fn from_words(opcode: Opcode, word: u32, aux: u32) -> Instr {
                #[allow(unused_mut, unused_variables, reason = "some instructions have no operands")]
                let mut unpacker = Unpacker { word: word >> 8, aux };
                match opcode {
                    $( Opcode::$name => Instr::$name { $( $field: unpacker.take::<$ty>() ),* }, )*
                }
            }

            /// Calls `visit` with the role of each operand, in order.
            #[inline]
            pub fn visit_operands(&self, mut visit: impl FnMut(Role)) {
                #[allow(unused, reason = "some instructions have no operands")]
                let visit = &mut visit;
                match *self {
                    $( Instr::$name { $( $field ),* } => { $( visit($field.role()); )* } )*
                }
            }

            /// Makes the jump, or the landing of the entry pushed, lead this many words from the next
            /// instruction on.
            #[allow(unused_variables, reason = "some instructions have no operands")]
            pub fn retarget(&mut self, distance: i32) {
                match self {
                    $( Instr::$name { $( $field ),* } => { $( $field.retarget(distance); )* } )*
                }
            }

            /// Adds `by` to the number of each register that operands name, and of each window.
            #[allow(unused_variables, reason = "some instructions have no operands")]
            pub fn move_registers(&mut self, by: u8) {
                match self {
                    $( Instr::$name { $( $field ),* } => { $( $field.move_register(by); )* } )*
                }
            }

            /// Calls `visit` with each operand's type, as its operand newtype is called, its text and its
            /// role.
            pub fn visit_texts(&self, mut visit: impl FnMut(&'static str, &dyn fmt::Display, Role)) {
                #[allow(unused, reason = "some instructions have no operands")]
                let visit = &mut visit;
                match *self {
                    $( Instr::$name { $( $field ),* } => {
                        $( visit(stringify!($ty), &$field, $field.role()); )*
                    } )*
                }
            }
        }

        impl fmt::Display for Instr {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                match *self {
                    $( Instr::$name { $( $field ),* } => {
                        f.write_str($mnemonic)?;
                        $( write!(f, " {}", $field)?; )*
                        Ok(())
                    } )*
                }
            }
        }

        // Operands fit the word: at most 24 bits beside the opcode, at most one aux word.
        $( const _: () = {
            let narrow: u32 = 0 $( + if <$ty as Operand>::WIDTH == 32 { 0 } else { <$ty as Operand>::WIDTH } )*;
            assert!(narrow <= 24 && Opcode::$name.words() <= 2);
            assert!($number > 0 && $number < 0xC0);
        }; )*
    };
}

for_each_opcode!(define_opcodes);

// Rows have the operands that the word after the mnemonic asks for.
const _: () = {
    let mut row = 0;
    while row < OPCODES.len() {
        let OpcodeInfo { opcode, substitute, callee, operands, slow_half, .. } = OPCODES[row];
        let last = if operands.is_empty() { "" } else { operands[operands.len() - 1].1 };
        match substitute {
            Substitute::Value => assert!(is(operands[0].1, "Dst"), "`value` needs a Dst"),
            Substitute::Test | Substitute::TestNot => {
                assert!(is(last, "Jump") || is(last, "Back"), "`test` needs a Jump or Back at its end")
            }
            Substitute::Call => {
                assert!(is(operands[2].1, "Want"), "a call wants values; `tail` is for tail calls")
            }
            Substitute::Tail => {
                assert!(!is(operands[2].1, "Want"), "a tail call has no place for values")
            }
            Substitute::Silent | Substitute::Effect | Substitute::Never => {}
        }
        match slow_half {
            SlowHalf::Gives => assert!(is(operands[0].1, "Dst"), "`gives` needs a Dst"),
            SlowHalf::Jumps | SlowHalf::Stays => {
                assert!(is(last, "Jump"), "`jumps` and `stays` need a Jump at their end")
            }
            SlowHalf::Test => {
                assert!(matches!(substitute, Substitute::Test | Substitute::TestNot), "the row is not a test")
            }
            SlowHalf::First => assert!(opcode.builtin().is_some(), "`first` needs a builtin"),
            SlowHalf::None | SlowHalf::Builtin | SlowHalf::Does | SlowHalf::Rest | SlowHalf::Quiet => {}
        }
        match callee {
            Some(CallTarget::Global) => {
                assert!(is(last, "WideSymbolIdx"), "a call of a symbol needs the symbol")
            }
            Some(CallTarget::Builtin) => {
                assert!(is(last, "BuiltinIdx"), "a call of a builtin needs the builtin")
            }
            _ => {}
        }
        // A return finds the call two words before its return address.
        assert!(callee.is_none() || opcode.words() == 2, "a call has two words");
        row += 1;
    }
};

/// Returns whether the operand type of this name is a jump back.
const fn is_back(operand: &str) -> bool {
    is(operand, "Back") || is(operand, "Back16") || is(operand, "Back24")
}

/// Returns whether two names are the same, at compile time.
const fn is(left: &str, right: &str) -> bool {
    let (left, right) = (left.as_bytes(), right.as_bytes());
    let mut at = 0;
    while at < left.len() && at < right.len() && left[at] == right[at] {
        at += 1;
    }
    at == left.len() && at == right.len()
}

struct Packer {
    word: u32,
    shift: u32,
    aux: Option<u32>,
}

impl Packer {
    fn new(opcode: Opcode) -> Packer {
        Packer { word: opcode as u32, shift: 8, aux: None }
    }

    fn put<T: Operand>(&mut self, operand: T) {
        if T::WIDTH == 32 {
            self.aux = Some(operand.to_bits());
        } else {
            self.word |= operand.to_bits() << self.shift;
            self.shift += T::WIDTH;
        }
    }

    fn finish(self) -> (u32, Option<u32>) {
        (self.word, self.aux)
    }
}

struct Unpacker {
    word: u32,
    aux: u32,
}

impl Unpacker {
    fn take<T: Operand>(&mut self) -> T {
        if T::WIDTH == 32 {
            return T::from_bits(self.aux);
        }
        let operand = T::from_bits(self.word);
        self.word >>= T::WIDTH;
        operand
    }
}

macro_rules! define_type_codes {
    ($( $(#[$doc:meta])* $name:ident = $number:literal, $symbol:literal; )*) => {
        /// Types that an instruction can test for, without a call.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[repr(u8)]
        pub enum TypeCode {
            $( $(#[$doc])* $name = $number, )*
        }

        impl TypeCode {
            /// All of them.
            pub const ALL: &[TypeCode] = &[$( TypeCode::$name ),*];

            /// Returns the type code with this number, unless there is none.
            pub fn from_number(number: u8) -> Option<TypeCode> {
                match number {
                    $( $number => Some(TypeCode::$name), )*
                    _ => None,
                }
            }

            /// Returns the name of the type, a symbol of `COMMON-LISP`.
            pub fn type_name(self) -> &'static str {
                match self {
                    $( TypeCode::$name => $symbol, )*
                }
            }
        }
    };
}

define_type_codes! {
    /// A pair.
    Cons = 0, "CONS";
    /// A pair or `NIL`.
    List = 1, "LIST";
    /// A symbol, `NIL` and `T` too.
    Symbol = 2, "SYMBOL";
    /// A keyword.
    Keyword = 3, "KEYWORD";
    /// Any number.
    Number = 4, "NUMBER";
    /// An integer of any size.
    Integer = 5, "INTEGER";
    /// An integer of one word.
    Fixnum = 6, "FIXNUM";
    /// A double float.
    Float = 7, "FLOAT";
    /// An integer or a ratio.
    Rational = 8, "RATIONAL";
    /// A character.
    Character = 9, "CHARACTER";
    /// A string, also one with a fill pointer.
    String = 10, "STRING";
    /// An array of rank 1.
    Vector = 11, "VECTOR";
    /// A simple general vector.
    SimpleVector = 12, "SIMPLE-VECTOR";
    /// Any array.
    Array = 13, "ARRAY";
    /// A function.
    Function = 14, "FUNCTION";
    /// A hash table.
    HashTable = 15, "HASH-TABLE";
    /// Anything but a pair.
    Atom = 16, "ATOM";
    /// `NIL`.
    Null = 17, "NULL";
    /// A list or a vector.
    Sequence = 18, "SEQUENCE";
    /// An integer, a ratio or a float.
    Real = 19, "REAL";
    /// A ratio.
    Ratio = 20, "RATIO";
    /// An integer too large for a word.
    Bignum = 21, "BIGNUM";
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn operands_survive_encoding() {
        let cases = [
            Instr::Move { dst: Dst(3), src: Reg(250) },
            Instr::LoadInt { dst: Dst(0), value: Int16(-32768) },
            Instr::AddInt { dst: Dst(1), left: Reg(2), value: Int8(-1) },
            Instr::JumpAlways { to: Jump24(0x7f_ffff) },
            Instr::Loop { to: Back24(-0x80_0000) },
            Instr::LoopCount { counter: Reg(1), limit: Reg(2), step: Int8(-128), to: Back(-70000) },
            Instr::Call { window: Window(9), count: Count(3), want: Want::ALL, pad: Pad(0) },
            Instr::ReturnAll {},
        ];
        for case in cases {
            let (word, aux) = case.encode();
            let code: Vec<u32> = std::iter::once(word).chain(aux).collect();
            assert_eq!(code.len(), case.opcode().words());
            assert_eq!(Instr::decode(&code, 0), Some(case));
        }
    }

    #[test]
    fn an_instruction_without_its_aux_word_does_not_decode() {
        let (word, _) =
            Instr::Call { window: Window(0), count: Count(0), want: Want::ONE, pad: Pad(0) }.encode();
        assert_eq!(Instr::decode(&[word], 0), None);
        assert_eq!(Instr::decode(&[0], 0), None);
    }
}

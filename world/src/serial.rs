//! Serial lines, as connections.

use esl_bytecode::datum::Datum;
use esl_host::{FromArgument, HostFailure, HostHandle, HostRows, Inbox, Right};
use tokio_serial::{DataBits, FlowControl, Parity, SerialPortBuilder, SerialPortBuilderExt, StopBits};

use crate::operation::spawned;
use crate::socket::{Connection, Socket};

/// Defines settings of a port, as arguments: what each datum, in print, stands for.
macro_rules! settings {
    ($( $name:ident($ty:ident), $type:literal { $( $datum:literal => $value:ident ),* } )*) => {
        $(
            struct $name($ty);

            impl FromArgument for $name {
                const TYPE: &'static str = $type;

                fn from_argument(datum: &Datum) -> Result<$name, HostFailure> {
                    match datum.to_string().as_str() {
                        $( $datum => Ok($name($ty::$value)), )*
                        _ => Err(HostFailure::of_type(datum, $type)),
                    }
                }
            }
        )*
    };
}

settings! {
    DataBitsArgument(DataBits), "INTEGER" { "5" => Five, "6" => Six, "7" => Seven, "8" => Eight }
    ParityArgument(Parity), "KEYWORD" { ":NONE" => None, ":ODD" => Odd, ":EVEN" => Even }
    StopBitsArgument(StopBits), "INTEGER" { "1" => One, "2" => Two }
    FlowControlArgument(FlowControl), "KEYWORD" {
        ":NONE" => None, ":SOFTWARE" => Software, ":HARDWARE" => Hardware
    }
}

/// Returns the functions of `:serial`.
pub(crate) fn rows(inbox: &Inbox) -> HostRows {
    let mut rows = HostRows::new(inbox);
    // A port may take its time.
    rows.operation(
        spawned,
        "%SERIAL-OPEN",
        ["socket", "path", "baud", "data-bits", "parity", "stop-bits", "flow-control"],
        "Opens the serial port PATH as SOCKET.",
        |socket: HostHandle<Socket>,
         path: String,
         baud: u32,
         DataBitsArgument(data_bits): DataBitsArgument,
         ParityArgument(parity): ParityArgument,
         StopBitsArgument(stop_bits): StopBitsArgument,
         FlowControlArgument(flow_control): FlowControlArgument| {
            let port = tokio_serial::new(&path, baud).data_bits(data_bits).parity(parity);
            let port = port.stop_bits(stop_bits).flow_control(flow_control);
            async move { open(socket, path, port) }
        },
    )
    .needs(Right::Serial, "path");
    rows
}

fn open(socket: HostHandle<Socket>, path: String, port: SerialPortBuilder) -> Result<(), HostFailure> {
    let port = port
        .open_native_async()
        .map_err(|error| HostFailure::new("SERIAL-ERROR", format!("`{path}` cannot be opened: {error}")))?;
    let (reader, writer) = tokio::io::split(port);
    socket.set((Connection::over(reader, writer), 0, path))
}

#[cfg(test)]
mod tests {
    use esl_bytecode::span::Span;
    use esl_bytecode::symbol::Symbol;
    use esl_host::IntoDatum;

    use super::*;

    #[test]
    fn each_setting_stands_for_that_of_the_port() {
        let keyword = |name: &str| Datum::symbol(Symbol::keyword(name), Span::default());
        for (bits, expected) in
            (5_i64..).zip([DataBits::Five, DataBits::Six, DataBits::Seven, DataBits::Eight])
        {
            let found = DataBitsArgument::from_argument(&bits.into_datum());
            assert!(found.is_ok_and(|found| found.0 == expected), "{bits}");
        }
        for (name, expected) in [("NONE", Parity::None), ("ODD", Parity::Odd), ("EVEN", Parity::Even)] {
            let found = ParityArgument::from_argument(&keyword(name));
            assert!(found.is_ok_and(|found| found.0 == expected), "{name}");
        }
        for (bits, expected) in (1_i64..).zip([StopBits::One, StopBits::Two]) {
            let found = StopBitsArgument::from_argument(&bits.into_datum());
            assert!(found.is_ok_and(|found| found.0 == expected), "{bits}");
        }
        for (name, expected) in [
            ("NONE", FlowControl::None),
            ("SOFTWARE", FlowControl::Software),
            ("HARDWARE", FlowControl::Hardware),
        ] {
            let found = FlowControlArgument::from_argument(&keyword(name));
            assert!(found.is_ok_and(|found| found.0 == expected), "{name}");
        }
        assert!(DataBitsArgument::from_argument(&9_i64.into_datum()).is_err());
        assert!(ParityArgument::from_argument(&keyword("MARK")).is_err());
    }
}

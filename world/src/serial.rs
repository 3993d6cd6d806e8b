//! Serial lines, as connections.

use esl_vm::host::HostFailure;
use tokio_serial::{DataBits, FlowControl, Parity, SerialPortBuilderExt, StopBits};

use crate::data::{CallArguments, failure, integer};
use crate::operation::Completion;
use crate::socket::{Connection, Sockets};

fn serial_failure(reason: impl ToString) -> HostFailure {
    failure("SERIAL-ERROR", reason)
}

/// `%SERIAL-OPEN`: number, path, baud, data bits, parity, stop bits, flow control.
pub(crate) async fn open(arguments: CallArguments, sockets: Sockets) -> Completion {
    let (number, path) = (arguments.number(0)?, arguments.text(1)?);
    let baud = u32::try_from(arguments.integer(2)?).map_err(serial_failure)?;
    let data_bits = match arguments.integer(3)? {
        5 => DataBits::Five,
        6 => DataBits::Six,
        7 => DataBits::Seven,
        _ => DataBits::Eight,
    };
    let parity = match arguments.text(4)?.as_str() {
        "ODD" => Parity::Odd,
        "EVEN" => Parity::Even,
        _ => Parity::None,
    };
    let stop_bits = if arguments.integer(5)? == 2 { StopBits::Two } else { StopBits::One };
    let flow_control = match arguments.text(6)?.as_str() {
        "SOFTWARE" => FlowControl::Software,
        "HARDWARE" => FlowControl::Hardware,
        _ => FlowControl::None,
    };
    let port = tokio_serial::new(&path, baud).data_bits(data_bits).parity(parity).stop_bits(stop_bits);
    let port = port.flow_control(flow_control).open_native_async();
    let port = port.map_err(|error| serial_failure(format!("`{path}` cannot be opened: {error}")))?;
    let (reader, writer) = tokio::io::split(port);
    sockets.set(number, Connection::over(reader, writer), 0, path)?;
    Ok(vec![integer(number)])
}

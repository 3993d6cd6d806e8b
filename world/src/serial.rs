//! Serial lines, as connections.

use esl_host::HostFailure;
use tokio_serial::{DataBits, FlowControl, Parity, SerialPortBuilder, SerialPortBuilderExt, StopBits};

use crate::data::{CallArguments, failure, integer};
use crate::operation::Completion;
use crate::socket::{Connection, Sockets};

fn serial_failure(reason: impl ToString) -> HostFailure {
    failure("SERIAL-ERROR", reason)
}

/// `%SERIAL-OPEN`: number, path, baud, data bits, parity, stop bits, flow control.
pub(crate) async fn open(arguments: CallArguments, sockets: Sockets) -> Completion {
    let (number, path) = (arguments.number(0)?, arguments.text(1)?);
    let port = settings(&arguments)?.open_native_async();
    let port = port.map_err(|error| serial_failure(format!("`{path}` cannot be opened: {error}")))?;
    let (reader, writer) = tokio::io::split(port);
    sockets.set(number, Connection::over(reader, writer), 0, path)?;
    Ok(vec![integer(number)])
}

/// Returns the port that is to be opened, with its settings.
fn settings(arguments: &CallArguments) -> Result<SerialPortBuilder, HostFailure> {
    let path = arguments.text(1)?;
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
    let port = tokio_serial::new(path, baud).data_bits(data_bits).parity(parity).stop_bits(stop_bits);
    Ok(port.flow_control(flow_control))
}

#[cfg(test)]
mod tests {
    use esl_bytecode::datum::Datum;

    use super::*;
    use crate::data::text;

    #[test]
    fn each_setting_reaches_the_port() {
        let call = |baud, data_bits, parity, stop_bits, flow: &str| -> Vec<Datum> {
            let (baud, data_bits, stop_bits) = (integer(baud), integer(data_bits), integer(stop_bits));
            vec![integer(1), text("/dev/a"), baud, data_bits, text(parity), stop_bits, text(flow)]
        };
        let port = tokio_serial::new("/dev/a", 9600);
        let bits = [DataBits::Five, DataBits::Six, DataBits::Seven, DataBits::Eight];
        for (number, data_bits) in (5..).zip(bits) {
            for (parity_name, parity) in
                [("NONE", Parity::None), ("ODD", Parity::Odd), ("EVEN", Parity::Even)]
            {
                let call = call(9600, number, parity_name, 1, "SOFTWARE");
                let expected = port.clone().data_bits(data_bits).parity(parity);
                let expected = expected.stop_bits(StopBits::One).flow_control(FlowControl::Software);
                assert_eq!(settings(&CallArguments(call)).ok(), Some(expected));
            }
        }
        let call_of_two = call(4_000_000, 8, "NONE", 2, "HARDWARE");
        let expected = port.baud_rate(4_000_000).stop_bits(StopBits::Two).flow_control(FlowControl::Hardware);
        assert_eq!(settings(&CallArguments(call_of_two)).ok(), Some(expected));
    }
}

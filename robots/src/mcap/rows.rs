//! The functions of `:mcap`.
//!
//! A function that reads a file has two forms: an operation, and one that returns at once (`…-NOW`) for
//! worlds whose time is virtual, where no operation reaches the outside.

use esl_bytecode::datum::Datum;
use esl_host::{HostFailure, HostHandle, HostRows, Inbox, Payload, Right};
use esl_world::spawned;

use super::output::OutputChannel;
use super::reading::{McapInput, McapReader, failure};
use super::writing::{McapWriter, options};

/// Returns what a function comes to that the disk may delay.
async fn in_thread<T: Send + 'static>(
    function: impl FnOnce() -> Result<T, HostFailure> + Send + 'static,
) -> Result<T, HostFailure> {
    tokio::task::spawn_blocking(function).await.map_err(failure)?
}

/// Returns the functions of `:mcap`.
pub(crate) fn rows(inbox: &Inbox) -> HostRows {
    let mut rows = HostRows::new(inbox);
    add_files(&mut rows);
    add_parts(&mut rows);
    add_readers(&mut rows);
    add_outputs(&mut rows);
    add_channels(&mut rows);
    add_writing(&mut rows);
    rows
}

/// Adds the functions of files that are read.
fn add_files(rows: &mut HostRows) {
    let mut made = 0;
    let opens = "Opens the file PATH, or the folder of a bag, and returns it.";
    rows.operation(spawned, "%MCAP-OPEN", ["path"], opens, move |path: String| {
        made += 1;
        let number = made;
        in_thread(move || Ok(HostHandle::new(number, McapInput::open(&path)?)))
    })
    .needs(Right::Read, "path");
    let mut made = 0;
    rows.at_once("%MCAP-OPEN-NOW", ["path"], opens, move |path: String| {
        made -= 1;
        Ok(HostHandle::new(made, McapInput::open(&path)?))
    })
    .needs(Right::Read, "path")
    .everywhere();
    rows.at_once("%MCAP-CLOSE", ["file"], "Closes FILE.", |file: HostHandle<McapInput>| {
        file.close();
        Ok(())
    })
    .everywhere()
    .closes();
    rows.at_once(
        "%MCAP-DAMAGE",
        ["file"],
        "Returns texts about the damage of FILE that was found so far.",
        |file: HostHandle<McapInput>| file.damage(),
    )
    .everywhere();
    rows.at_once(
        "%MCAP-CHANNELS",
        ["file"],
        "Returns the channels of FILE.",
        |file: HostHandle<McapInput>| file.channels(),
    )
    .everywhere();
    rows.at_once("%MCAP-FIGURES", ["file"], "Returns the figures of FILE.", |file: HostHandle<McapInput>| {
        file.figures()
    })
    .everywhere();
}

/// Adds the functions of the records beside the messages.
fn add_parts(rows: &mut HostRows) {
    let metadata = "Returns the records of metadata of FILE.";
    rows.operation(spawned, "%MCAP-METADATA", ["file"], metadata, |file: HostHandle<McapInput>| {
        in_thread(move || file.metadata())
    });
    rows.at_once("%MCAP-METADATA-NOW", ["file"], metadata, |file: HostHandle<McapInput>| file.metadata())
        .everywhere();
    rows.at_once(
        "%MCAP-ATTACHMENTS",
        ["file"],
        "Returns the attachments of FILE: name, media type, time and size.",
        |file: HostHandle<McapInput>| file.attachments(),
    )
    .everywhere();
    let data = "Returns the data of the attachment with this NUMBER.";
    rows.operation(
        spawned,
        "%MCAP-ATTACHMENT",
        ["file", "number"],
        data,
        |file: HostHandle<McapInput>, number: usize| in_thread(move || file.attachment(number)),
    );
    rows.at_once(
        "%MCAP-ATTACHMENT-NOW",
        ["file", "number"],
        data,
        |file: HostHandle<McapInput>, number: usize| file.attachment(number),
    )
    .everywhere();
}

/// Adds the functions of readers.
fn add_readers(rows: &mut HostRows) {
    let mut made = 0;
    rows.at_once(
        "%MCAP-READ",
        ["file", "topics", "start", "end"],
        "Returns a reader of the messages of FILE.",
        move |file: HostHandle<McapInput>,
              topics: Option<Vec<String>>,
              start: Option<u64>,
              end: Option<u64>| {
            made += 1;
            Ok(HostHandle::new(made, file.read(topics, start, end)?))
        },
    )
    .everywhere();
    let batch = "Returns the messages of the batch with this NUMBER, by their parts; NIL at the end.";
    rows.operation(
        spawned,
        "%MCAP-BATCH",
        ["reader", "number", "is-raw"],
        batch,
        |reader: HostHandle<McapReader>, number: u64, is_raw: bool| {
            in_thread(move || reader.batch(number, is_raw))
        },
    );
    rows.at_once(
        "%MCAP-BATCH-NOW",
        ["reader", "number", "is-raw"],
        batch,
        |reader: HostHandle<McapReader>, number: u64, is_raw: bool| reader.batch(number, is_raw),
    )
    .everywhere();
}

/// Adds the functions of files that are written.
fn add_outputs(rows: &mut HostRows) {
    let mut made = 0;
    rows.operation(
        spawned,
        "%MCAP-CREATE",
        ["path", "compression", "chunk-size", "profile"],
        "Creates the file PATH, and returns it.",
        move |path: String, compression: Option<String>, chunk_size: Option<u64>, profile: String| {
            made += 1;
            let number = made;
            in_thread(move || {
                let options = options(compression.as_deref(), chunk_size, profile)?;
                Ok(HostHandle::new(number, McapWriter::create(&path, &options)?))
            })
        },
    )
    .needs(Right::Write, "path");
    let mut made = 0;
    rows.at_once(
        "%MCAP-CREATE-IN-MEMORY",
        ["compression", "chunk-size", "profile"],
        "Returns a file whose bytes %MCAP-TAKE returns.",
        move |compression: Option<String>, chunk_size: Option<u64>, profile: String| {
            made -= 1;
            let options = options(compression.as_deref(), chunk_size, profile)?;
            Ok(HostHandle::new(made, McapWriter::in_memory(&options)?))
        },
    )
    .everywhere();
    rows.at_once(
        "%MCAP-TAKE",
        ["file"],
        "Returns the bytes of a file in memory since the last call.",
        |file: HostHandle<McapWriter>| Ok(file.output.take()),
    )
    .everywhere();
    rows.at_once("%MCAP-FLUSH", ["file"], "Ends the chunk of FILE.", |file: HostHandle<McapWriter>| {
        file.output.flush();
        Ok(())
    })
    .everywhere();
    rows.at_once("%MCAP-FINISH", ["file"], "Completes FILE.", |file: HostHandle<McapWriter>| {
        file.output.finish();
        Ok(())
    })
    .everywhere();
    rows.operation(
        spawned,
        "%MCAP-WRITTEN",
        ["file"],
        "Waits until all of FILE is written.",
        |file: HostHandle<McapWriter>| async move { file.output.written().await.map_err(failure) },
    );
}

/// Adds the functions of channels.
fn add_channels(rows: &mut HostRows) {
    rows.at_once(
        "%MCAP-ROS-CHANNEL",
        ["file", "topic", "type", "text", "metadata"],
        "Opens a channel of messages of ROS 2, and returns its number.",
        |file: HostHandle<McapWriter>,
         topic: String,
         name: String,
         text: Option<String>,
         metadata: Vec<(String, String)>| {
            Ok(i64::from(file.ros_channel(topic, &name, text, metadata)?))
        },
    )
    .everywhere();
    rows.at_once(
        "%MCAP-CHANNEL",
        ["file", "topic", "encoding", "schema-name", "schema-encoding", "schema", "metadata"],
        "Opens a channel of any messages, and returns its number.",
        |file: HostHandle<McapWriter>,
         topic: String,
         encoding: String,
         name: Option<String>,
         form: String,
         Payload(text): Payload,
         metadata: Vec<(String, String)>| {
            let schema = name.map(|name| (name, form, text));
            Ok(i64::from(file.channel(OutputChannel { topic, encoding, schema, metadata })?))
        },
    )
    .everywhere();
}

/// Adds the functions that write.
fn add_writing(rows: &mut HostRows) {
    rows.at_once(
        "%MCAP-WRITE",
        ["file", "channel", "time", "publish-time", "sequence", "message"],
        "Writes MESSAGE. Returns whether there is room for more.",
        |file: HostHandle<McapWriter>,
         channel: u16,
         time: u64,
         publish_time: u64,
         sequence: Option<u32>,
         message: Datum| { file.write(channel, (time, publish_time), sequence, &message) },
    )
    .everywhere();
    rows.at_once(
        "%MCAP-WRITE-ALL",
        ["file", "channel", "times", "messages"],
        "Writes MESSAGES with TIMES, as many seconds. Returns whether there is room for more.",
        |file: HostHandle<McapWriter>, channel: u16, times: Datum, messages: Datum| {
            file.write_all(channel, &times, &messages)
        },
    )
    .everywhere();
    rows.at_once(
        "%MCAP-ATTACH",
        ["file", "name", "media-type", "time", "data"],
        "Writes an attachment. Returns whether there is room for more.",
        |file: HostHandle<McapWriter>,
         name: String,
         media_type: String,
         time: u64,
         Payload(data): Payload| { Ok(file.output.attach(name, media_type, time, &data)) },
    )
    .everywhere();
    rows.at_once(
        "%MCAP-WRITE-METADATA",
        ["file", "name", "metadata"],
        "Writes names and values. Returns whether there is room for more.",
        |file: HostHandle<McapWriter>, name: String, metadata: Vec<(String, String)>| {
            Ok(file.output.write_metadata(name, metadata))
        },
    )
    .everywhere();
}

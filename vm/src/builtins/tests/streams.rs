use esl_host::{Rights, VirtualHost};

use super::{check_all, evaluate};
use crate::vm::{Config, Vm};

#[test]
fn strings_are_read() {
    check_all(&[
        ("(%make-string-input \"ab c\" 0 nil)", "<Some(Stream)>"),
        ("(peek-char nil $0)", "#\\a"),
        ("(read-char $0)", "#\\a"),
        ("(unread-char #\\a $0)", "NIL"),
        ("(peek-char #\\b $0)", "#\\b"),
        ("(read-char $0)", "#\\b"),
        ("(peek-char t $0)", "#\\c"),
        ("(%string-input-position $0)", "3"),
        ("(%set-string-input-position $0 5)", "NIL"),
        ("(%set-string-input-position $0 nil)", "T"),
        ("(read-char $0 nil)", "NIL"),
        ("(%set-string-input-position $0 3)", "T"),
        ("(read-line $0)", "\"c\" ; T"),
        ("(read-line $0 nil 'end)", "END ; T"),
        ("(read-char $0 nil)", "NIL"),
        ("(read-char $0)", "end-of-file"),
        ("(write-char #\\a $0)", "stream-error: it is not open for writing"),
        ("(%close $0)", "T"),
        ("(read-char $0)", "stream-error: it is closed"),
        ("(%close $0)", "NIL"),
        ("(read-char 5)", "type-error 5 STREAM"),
        ("(input-stream-p $0)", "T"),
        ("(open-stream-p $0)", "NIL"),
    ]);
}

#[test]
fn strings_are_gathered_and_columns_counted() {
    check_all(&[
        ("(%make-string-output)", "<Some(Stream)>"),
        (
            "(%write-string \"a long text that needs more than the first buffer\" $0 2 nil)",
            "\"a long text that needs more than the first buffer\"",
        ),
        ("(%stream-column $0)", "47"),
        ("(fresh-line $0)", "T"),
        ("(fresh-line $0)", "NIL"),
        ("(write-char #\\x $0)", "#\\x"),
        ("(%stream-column $0)", "1"),
        ("(get-output-stream-string $0)", "\"long text that needs more than the first buffer\\nx\""),
        ("(get-output-stream-string $0)", "\"\""),
        ("(%write-string 5 $0 0 nil)", "type-error 5 STRING"),
        ("(get-output-stream-string 5)", "type-error 5 STRING-STREAM"),
    ]);
}

fn machine(host: VirtualHost) -> Vm {
    Vm::new(Config::default(), Box::new(host)).unwrap()
}

#[test]
fn standard_streams_reach_the_host() {
    let host = VirtualHost::new().with_input("one\ntwo");
    let captured = host.captured();
    let mut vm = machine(host);
    assert_eq!(evaluate(&mut vm, "(%write-string \"prompt\" nil 0 nil)"), "\"prompt\"");
    assert_eq!(captured.output(), "");
    assert_eq!(evaluate(&mut vm, "(read-line)"), "\"one\" ; NIL");
    assert_eq!(captured.output(), "prompt", "written before the program waits for an answer");
    assert_eq!(evaluate(&mut vm, "(listen)"), "T");
    assert_eq!(evaluate(&mut vm, "(read-line)"), "\"two\" ; T");
    assert_eq!(evaluate(&mut vm, "(read-line t nil 'end)"), "END ; T");
    assert_eq!(evaluate(&mut vm, "(write-char #\\! (%standard-stream 2))"), "#\\!");
    assert_eq!(captured.error(), "!");
}

#[test]
fn files_are_read_and_written_whole() {
    let host = VirtualHost::new().with_file("in", "äb\n").with_file("log", "old\n");
    let captured = host.captured();
    let mut vm = machine(host);
    assert_eq!(evaluate(&mut vm, "(%file-text \"in\")"), "\"äb\\n\"");
    let missing = "file-error none: it cannot be read: the file does not exist";
    assert_eq!(evaluate(&mut vm, "(%file-text \"none\")"), missing);
    let exists = "file-error log: it cannot be written: the file exists already";
    assert_eq!(evaluate(&mut vm, "(%write-bytes \"log\" (%bytes-of-string \"x\") 2)"), exists);
    assert_eq!(evaluate(&mut vm, "(%write-bytes \"log\" (%bytes-of-string \"new\") 1)"), "NIL");
    assert_eq!(captured.file("log"), Some(b"old\nnew".to_vec()));
    assert_eq!(evaluate(&mut vm, "(%write-bytes \"out\" (%bytes-of-string \"x\") 0)"), "NIL");
    assert_eq!(captured.file("out"), Some(b"x".to_vec()));
    assert_eq!(evaluate(&mut vm, "(%delete-file \"out\")"), "T");
    assert_eq!(evaluate(&mut vm, "(%file-exists-p \"out\")"), "NIL");
}

#[test]
fn refused_files_are_failures() {
    let mut vm = machine(VirtualHost::new().with_rights(Rights::none().with_modules("lib")));
    for (form, refused) in [
        ("(%file-text \"in\")", "denied read in --allow-read=in"),
        ("(%file-bytes \"../in\")", "denied read ../in --allow-read=../in"),
        ("(%file-exists-p \"lib/a.esl\")", "denied read lib/a.esl --allow-read=lib/a.esl"),
        ("(%compiled-file \"in\")", "denied read in --allow-read=in"),
        ("(%write-bytes \"out\" (%bytes-of-string \"\") 0)", "denied write out --allow-write=out"),
        ("(%delete-file \"out\")", "denied write out --allow-write=out"),
        ("(%file-exists-p \"lib/a.esl\" t)", "NIL"),
        ("(%narrow-rights '(:read))", "type-error :READ LIST"),
        ("(%narrow-rights nil)", "program-error: rights are narrowed in a scope only"),
    ] {
        assert_eq!(evaluate(&mut vm, form), refused);
    }
}

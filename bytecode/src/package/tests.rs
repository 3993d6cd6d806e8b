use super::*;

#[track_caller]
fn check_read(text: &str, expected: &str) {
    let mut packages = Packages::standard();
    let read = match text.split_once(':') {
        None => packages.read(PackageId::USER, None, text, false),
        Some((prefix, name)) => {
            let internal = name.starts_with(':');
            packages.read(PackageId::USER, Some(prefix), name.trim_start_matches(':'), internal)
        }
    };
    let read = read.map_or_else(|error| format!("{error:?}"), |symbol| format!("{symbol:?}"));
    assert_eq!(read, expected, "{text}");
}

#[test]
fn names_denote_what_a_user_expects() {
    check_read("CAR", "COMMON-LISP::CAR");
    check_read("SIGNAL", "ESL::SIGNAL");
    check_read("CL:SIGNAL", "COMMON-LISP::SIGNAL");
    check_read("COMMON-LISP::SIGNAL", "COMMON-LISP::SIGNAL");
    check_read("ESL:SIGNAL", "ESL::SIGNAL");
    check_read("ESL:CAR", "COMMON-LISP::CAR");
    check_read("FOO", "ESL-USER::FOO");
    check_read("USER::FOO", "ESL-USER::FOO");
    check_read("ESL::%SET-FUNCTION", "ESL::%SET-FUNCTION");
    check_read("%SET-FUNCTION", "ESL-USER::%SET-FUNCTION");
    check_read(":NAME", "KEYWORD::NAME");
    check_read("KEYWORD:NAME", "KEYWORD::NAME");
    check_read("ESL:%SET-FUNCTION", "NotExternal { exists: true }");
    check_read("USER:FOO", "NotExternal { exists: false }");
    check_read("CL:FOO", "NotExternal { exists: false }");
    check_read("CL::FOO", "NotExternal { exists: false }");
    check_read("NOWHERE:FOO", "NoPackage(\"NOWHERE\")");
}

#[test]
fn a_name_that_was_read_is_found_again() {
    let mut packages = Packages::standard();
    assert_eq!(packages.find(PackageId::USER, "FOO"), None);
    let (foo, status) = packages.intern(PackageId::USER, "FOO");
    assert_eq!(status, None);
    assert_eq!(packages.find(PackageId::USER, "FOO"), Some((foo.clone(), Status::Internal)));
    assert_eq!(packages.intern(PackageId::USER, "FOO"), (foo, Some(Status::Internal)));
    let car = (Symbol::cl("CAR"), Status::Inherited);
    assert_eq!(packages.find(PackageId::USER, "CAR"), Some(car.clone()));
    packages.intern(PackageId::USER, "CAR");
    assert_eq!(packages.find(PackageId::USER, "CAR"), Some(car));
    assert_eq!(packages.find(PackageId::ESL, "CAR"), Some((Symbol::cl("CAR"), Status::External)));
}

#[test]
fn symbols_are_written_so_that_they_can_be_read() {
    let mut packages = Packages::standard();
    packages.register(PackageId::ESL, "%HELPER", false);
    let check = |symbol: Symbol, current, expected: &str| {
        assert_eq!(packages.qualifier(&symbol, current).to_string(), expected, "{symbol:?}");
    };
    check(Symbol::cl("CAR"), PackageId::USER, "");
    check(Symbol::cl("SIGNAL"), PackageId::USER, "COMMON-LISP:");
    check(Symbol::esl("SIGNAL"), PackageId::USER, "");
    check(Symbol::esl("SIGNAL"), PackageId::CL, "ESL:");
    check(Symbol::esl("%HELPER"), PackageId::USER, "ESL::");
    check(Symbol::esl("%HELPER"), PackageId::ESL, "");
    check(Symbol::keyword("NAME"), PackageId::USER, ":");
    check(Symbol::keyword("NAME"), PackageId::KEYWORD, ":");
    check(Symbol::uninterned(3, "G"), PackageId::USER, "#:");
    check(Symbol::new(&"GONE".into(), "X"), PackageId::USER, "GONE::");
}

#[test]
fn exports_are_inherited() {
    let mut packages = Packages::standard();
    let tools = packages.make_package("TOOLS", &["T2"], &[PackageId::ESL]).unwrap();
    assert_eq!(packages.named("T2"), Some(tools));
    let hammer = packages.intern(tools, "HAMMER").0;
    assert_eq!(packages.qualifier(&hammer, PackageId::USER), Qualifier::Internal("TOOLS".into()));
    packages.export(tools, &hammer).unwrap();
    assert_eq!(packages.qualifier(&hammer, PackageId::USER), Qualifier::External("TOOLS".into()));
    packages.use_package(PackageId::USER, tools).unwrap();
    assert_eq!(packages.find(PackageId::USER, "HAMMER"), Some((hammer.clone(), Status::Inherited)));
    assert_eq!(packages.qualifier(&hammer, PackageId::USER), Qualifier::None);
    // An inherited symbol may be exported further.
    packages.export(PackageId::USER, &hammer).unwrap();
    assert_eq!(packages.find(PackageId::USER, "HAMMER"), Some((hammer, Status::External)));
    let unknown = Symbol::new(packages.name(tools), "SAW");
    assert_eq!(packages.export(tools, &unknown), Err(PackageError::NotAccessible(unknown)));
}

#[test]
fn one_name_never_denotes_two_symbols() {
    let mut packages = Packages::standard();
    let one = packages.make_package("ONE", &[], &[PackageId::ESL]).unwrap();
    let two = packages.make_package("TWO", &[], &[PackageId::ESL]).unwrap();
    let conflict = |package: &str| PackageError::Conflict { name: "X".to_owned(), package: package.into() };
    let x1 = packages.intern(one, "X").0;
    let x2 = packages.intern(two, "X").0;
    packages.export(one, &x1).unwrap();
    packages.export(two, &x2).unwrap();
    assert_eq!(packages.make_package("BOTH", &[], &[one, two]), Err(conflict("BOTH")));
    assert_eq!(packages.named("BOTH"), None);
    assert_eq!(packages.use_package(two, one), Err(conflict("TWO")));
    assert_eq!(packages.import(two, &x1), Err(conflict("TWO")));
    packages.shadow(two, "X").unwrap();
    packages.use_package(two, one).unwrap();
    assert_eq!(packages.find(two, "X"), Some((x2, Status::External)));
    // A user of the package stands in the way of an export.
    let y1 = packages.intern(one, "Y").0;
    packages.intern(two, "Y");
    assert!(matches!(packages.export(one, &y1), Err(PackageError::Conflict { .. })));
    packages.shadow(two, "Y").unwrap();
    packages.export(one, &y1).unwrap();
    let three = packages.make_package("THREE", &[], &[one]).unwrap();
    assert_eq!(packages.use_package(three, two), Err(conflict("THREE")));
}

#[test]
fn the_standard_packages_do_not_change() {
    let mut packages = Packages::standard();
    let standard = Err(PackageError::Standard("COMMON-LISP".into()));
    assert_eq!(packages.shadow(PackageId::CL, "X"), standard);
    assert_eq!(packages.use_package(PackageId::CL, PackageId::ESL), standard);
    let taken = Err(PackageError::NameTaken("CL".to_owned()));
    assert_eq!(packages.make_package("MINE", &["CL"], &[]), taken);
    assert_eq!(packages.external_names(PackageId::CL).len(), CL_NAMES.len());
}

#[test]
fn esl_exports_the_whole_language() {
    let packages = Packages::standard();
    let names = packages.external_names(PackageId::ESL);
    assert!(CL_NAMES.iter().all(|name| names.contains(name)));
    for name in CL_NAMES {
        let home = if TAKEN_OVER.contains(&name) { Symbol::esl(name) } else { Symbol::cl(name) };
        assert_eq!(packages.find(PackageId::USER, name), Some((home, Status::Inherited)));
    }
}

use super::*;

#[test]
fn names_of_instances() {
    let name = |text| name_and_path(text).map(|(name, path)| (name, path.to_owned())).unwrap();
    assert_eq!(name("a/PmsmPlant.fmu"), ("PmsmPlant".into(), "a/PmsmPlant.fmu".into()));
    assert_eq!(name("p=a/x=y.fmu"), ("p".into(), "a/x=y.fmu".into()));
    assert_eq!(name("a=b/c.fmu"), ("a".into(), "b/c.fmu".into()));
    assert_eq!(name("./a=b/c.fmu"), ("c".into(), "./a=b/c.fmu".into()));
    assert!(name_and_path("=x.fmu").is_err());
}

#[test]
fn what_is_not_said_comes_from_the_fmus() {
    let experiment = |stop, step| Experiment { start: None, stop, step, tolerance: None };
    let of = |experiments: &[Experiment]| Loaded { experiments: experiments.to_vec(), ..Loaded::default() };
    let two = of(&[experiment(Some(2.0), Some(1e-4)), experiment(Some(3.0), Some(2e-4))]);
    let s = two.settings(None, None, None, true);
    assert_eq!((s.start, s.stop, s.step, s.sequential), (0.0, 3.0, 1e-4, true));
    assert!((two.settings(Some(5.0), None, None, false).stop - 8.0).abs() < 1e-12);
    let s = of(&[experiment(None, None)]).settings(None, Some(4.0), None, false);
    assert_eq!((s.stop, s.step), (4.0, 0.004));
}

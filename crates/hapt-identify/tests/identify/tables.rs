//! Tables in the formats of labs.

use hapt_identify::{Columns, text_of};

fn near(a: &[f64], b: &[f64]) {
    assert!(a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12), "{a:?} {b:?}");
}

#[test]
fn decimal_commas_comments_and_units_in_brackets_are_read() {
    let text = "% a rig\ntimestamp [s];pos [rad];motor_torque [N.m]\n0,5;1,25;-0,5\n0,6;1,5;0,25\n";
    let columns = Columns::parse("torque=motor_torque").unwrap();
    let (rows, _) = columns.read(text).unwrap();
    near(&rows[0], &[0.5, 0.6]);
    near(&rows[1], &[1.25, 1.5]);
    near(&rows[2], &[-0.5, 0.25]);
}

#[test]
fn a_table_is_the_same_in_every_encoding_of_its_text() {
    let table = "Zeit [µs];Winkel [°];M [mN.m]\r\n0;1,5;-2\r\n1;2,5;3\r\n";
    let columns = Columns::parse("time=Zeit,position=Winkel,torque=M").unwrap();
    let latin: Vec<u8> = table.chars().map(|c| u8::try_from(u32::from(c)).unwrap()).collect();
    let marked = |to: fn(u16) -> [u8; 2]| [0xfeff].into_iter().chain(table.encode_utf16()).flat_map(to).collect();
    let files: [Vec<u8>; 5] =
        [table.into(), ["\u{feff}", table].concat().into(), latin, marked(u16::to_le_bytes), marked(u16::to_be_bytes)];
    for file in files {
        let [times, positions, torques] = columns.read(&text_of(file.clone()).unwrap()).unwrap().0;
        near(&times, &[0.0, 1e-6]);
        near(&positions, &[1.5, 2.5].map(f64::to_radians));
        near(&torques, &[-2e-3, 3e-3]);
    }
    let mut cut: Vec<u8> = marked(u16::to_le_bytes);
    cut.pop();
    for binary in [cut, b"t_s,x_rad\n\0\x01".to_vec(), vec![0x89, b'P', b'N', b'G', 0x1a, 0xff, 0]] {
        let error = text_of(binary).unwrap_err().to_string();
        assert!(error.contains("not text (UTF-8, UTF-16 or Latin-1)"), "{error}");
    }
}

#[test]
fn a_current_is_a_torque_with_the_motors_constant_and_a_gear() {
    let text = "t_s\tangle_rad\tmotor_mA\n0\t0\t500\n1\t1\t-250\n";
    let columns =
        Columns { torque_constant: Some(0.05), ratio: Some(15.0), ..Columns::parse("torque=motor_mA").unwrap() };
    near(&columns.read(text).unwrap().0[2], &[0.375, -0.1875]);
    let error = Columns::parse("torque=motor_mA").unwrap().read(text).unwrap_err().to_string();
    assert!(error.contains("--torque-constant"), "{error}");
}

#[test]
fn missing_and_repeated_samples_are_left_out_up_to_a_tenth() {
    let row = |k: usize| match k {
        20 => "20,,1".to_string(),
        30 => "30,nan,1".to_string(),
        41 => "40,1,0".to_string(),
        _ => format!("{k},{},{}", k % 7, k % 2),
    };
    let table = |of: &dyn Fn(usize) -> String| {
        let rows: String = (0..100).map(|k| of(k) + "\n").collect();
        Columns::default().read(&format!("t_ms,angle_deg,tau_Nm\n{rows}"))
    };
    // A torque acts without a position too.
    let ([times, positions, torques], _) = table(&row).unwrap();
    assert_eq!(times.len(), 99);
    assert!((0..99).all(|k| positions[k].is_nan() == [20, 30].contains(&k)), "{positions:?}");
    assert!(torques.iter().all(|torque| torque.is_finite()));
    assert!(table(&|k| if k % 5 == 0 { format!("{k},,1") } else { row(k) }).is_err());
}

#[test]
fn spaces_separate_columns_where_they_separate_numbers() {
    let read = |text: &str| Columns::default().read(text).unwrap().0;
    let spaced = read("  t_s   angle_rad tau_Nm\n 0.0  1.5    -2 \n 0.1   1,5     3\n");
    let tabbed = read("t_s\tangle_rad\ttau_Nm\n0.0\t1.5\t-2\n0.1\t1,5\t3\n");
    assert_eq!(spaced, tabbed);
}

/// Samples of an even clock with times in whole milliseconds, or of four digits.
#[test]
fn times_that_were_rounded_are_those_of_an_even_clock() {
    let read = |time: &dyn Fn(f64) -> String, position: &dyn Fn(usize) -> f64| {
        let row = |k: usize| format!("{},{},{}\n", time(0.43e-3 * k as f64), position(k), k / 50 % 2);
        let rows: String = (0..3000).map(row).collect();
        Columns::default().read_all(&format!("t_s,angle_rad,tau_Nm\n{rows}"))
    };
    let swings = |k: usize| (0.01 * k as f64).sin();
    let digits = |t: f64| format!("{:.*}", 3 - t.max(1e-4).log10().floor() as usize, t);
    let times: [&dyn Fn(f64) -> String; 3] =
        [&|t| format!("{t:.3}"), &|t| format!("{:.3}", (t * 1e3).floor() / 1e3), &digits];
    for time in times {
        let found = read(time, &swings).unwrap();
        assert_eq!(found.times.len(), 3000);
        let off = found.times.iter().enumerate().map(|(k, t)| (t - 0.43e-3 * k as f64).abs());
        assert!(off.fold(0.0, f64::max) < 1.1e-3);
        // The last time less the first one is worse known than to a thousandth.
        assert!((found.period.unwrap() - 0.43e-3).abs() < 1e-4 * 0.43e-3, "{:?}", found.period);
    }
    // Lines that were written twice are no samples, and times with a pause are of no even clock.
    let twice = |t: f64| format!("{:.5}", (t / 0.86e-3 + 0.01).floor() * 0.86e-3);
    assert!(read(&twice, &|k| (k / 2) as f64).unwrap_err().to_string().contains("repeat the time before"));
    // Of whole seconds the first and the last one are parts.
    assert!(read(&|t| format!("{:.1}", t), &swings).is_err());
    let pause = |t: f64| format!("{:.3}", if t > 0.6 { t + 0.4 } else { t });
    assert!(read(&pause, &swings).is_err());
}

#[test]
fn what_may_be_meant_is_listed_with_its_range() {
    let text = "t_s,motor_pos_rad,link_pos_rad,applied_Nm,spare_Nm\n0,0,2,1,7\n1,1,3,-1,7\n";
    let error = Columns::default().read(text).unwrap_err().to_string();
    for words in
        ["may both be the position", "link_pos_rad (2 to 3: may be a position)", "spare_Nm (stands still at 7)"]
    {
        assert!(error.contains(words), "{words}: {error}");
    }
    // A constant torque was not recorded.
    let error = Columns::parse("position=link_pos_rad,torque=spare_Nm").unwrap().read(text).unwrap_err().to_string();
    assert!(error.contains("spare_Nm stands still at 7"), "{error}");
}

#[test]
fn a_voltage_is_a_torque_at_rest_and_a_damping_that_the_motor_adds() {
    let text = "t_s,angle_rad,drive_V\n0,0,2\n1,1,-1\n";
    let columns = Columns {
        torque_constant: Some(0.05),
        resistance: Some(2.0),
        ratio: Some(3.0),
        ..Columns::parse("torque=drive_V").unwrap()
    };
    let read = columns.read_all(text).unwrap();
    near(&read.torques, &[0.15, -0.075]);
    near(&[read.back_damping], &[0.15 * 0.15 / 2.0]);
    for missing in [Columns { resistance: None, ..columns.clone() }, Columns { torque_constant: None, ..columns }] {
        let error = missing.read_all(text).unwrap_err().to_string();
        assert!(error.contains("--torque-constant") && error.contains("--resistance"), "{error}");
    }
}

#[test]
fn a_unit_can_be_given_to_a_column_without_one() {
    let text = "t,angle,u,sensor\n0,0,2,5\n1000,180,-1,6\n";
    let columns = Columns::parse("time=t [ms],position=angle [deg],torque=u [mN.m],force=sensor").unwrap();
    let read = columns.read_all(text).unwrap();
    near(&read.times, &[0.0, 1.0]);
    near(&read.positions, &[0.0, std::f64::consts::PI]);
    near(&read.torques, &[2e-3, -1e-3]);
    near(&read.forces.unwrap(), &[5.0, 6.0]);
    let error = Columns::default().read_all(text).unwrap_err().to_string();
    assert!(error.contains("no known unit") || error.contains("looks like"), "{error}");
}

#[test]
fn a_line_of_more_fields_than_names_is_refused_with_its_number() {
    let read = |text: &str| Columns::default().read(text).unwrap_err().to_string();
    let error = read("t_s,angle_rad,tau_Nm\n0,1,2\n0.5,1,2,3\n");
    assert!(error.contains("line 3 has 4 fields under 3 names"), "{error}");
    // Decimal commas between separating commas.
    let error = read("t_s,angle_rad,tau_Nm\n0,5,1,25,0,5\n");
    assert!(error.contains("line 2 has 6 fields") && error.contains("semicolons"), "{error}");
    // The rest of a line without a number is no field.
    assert_eq!(Columns::default().read("t_s,angle_rad,tau_Nm\n0,1,2,\n1,2,3, \n").unwrap().0[0].len(), 2);
}

#[test]
fn a_table_without_names_or_separators_says_which_are_expected() {
    let read = |text: &str| Columns::default().read(text).unwrap_err().to_string();
    assert!(read("0,1,2\n1,2,3\n").contains("the first line is numbers"), "{}", read("0,1,2\n1,2,3\n"));
    let error = read("t (s) angle (rad) tau (Nm)\n0 1 2\n");
    assert!(error.contains("tabs or spaces between columns"), "{error}");
    let error = read("t_s,master_rad,slave_rad,tau_Nm\n0,1,2,1\n1,2,3,-1\n");
    assert!(error.contains("by their units 2 columns may be the position"), "{error}");
}

#[test]
fn a_line_of_units_below_the_names_gives_them_units() {
    let read = |text: &str| Columns::parse("").unwrap().read(text).unwrap().0;
    for text in [
        "Time,Angle,Torque,Note\nms,deg,mN.m,\n0,90,5,1\n2.5,-90,-7,1\n",
        "\u{feff}# of a rig\nTime;Angle;Torque\n[ms];(deg);\"mN.m\"\n0;90;5\n2,5;-90;-7\n",
        "Time\tAngle\tTorque\nms\tdeg\tmNm\n0\t90\t5\n2.5\t-90\t-7\n",
        "Time  Angle Torque\nms    deg   mNm\n 0    90    5\n 2.5  -90   -7\n",
    ] {
        let [times, positions, torques] = read(text);
        near(&times, &[0.0, 2.5e-3]);
        near(&positions, &[std::f64::consts::FRAC_PI_2, -std::f64::consts::FRAC_PI_2]);
        near(&torques, &[5e-3, -7e-3]);
    }
    // A line with words but without units is a broken sample, and lines keep their numbers.
    let wrong = |text: &str| Columns::parse("").unwrap().read(text).unwrap_err().to_string();
    let words = wrong("t_s,angle_rad,tau_Nm\non,off,on\n0,1,2\n");
    assert!(words.contains("line 2") && words.contains("\"off\""), "{words}");
    let words = wrong("t,angle,tau\ns,rad,Nm\n0,1,2\n0.1,1,x\n");
    assert!(words.contains("line 4") && words.contains("\"x\""), "{words}");
}

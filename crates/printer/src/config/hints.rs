//! What to write for an option: the second half of every message about one that is missing or wrong.

/// What an option holds, with an example.
pub(super) fn hint(key: &str) -> &'static str {
    match key {
        "kinematics" => "`kinematics: cartesian`, corexy, corexz, hybrid_corexy, hybrid_corexz or delta",
        "delta_radius" => "the distance in mm from the middle to where the arms' carriages ride, e.g. 134",
        "print_radius" => "the radius in mm of what can be printed on, e.g. 110",
        "minimum_z_position" => "the lowest position in mm that Z may go to, e.g. 0",
        "arm_length" => "the length of the diagonal arms in mm, from joint to joint, e.g. 270",
        "angle" => "the tower's direction in degrees: usually 210, 330 and 90 for a, b and c",
        "max_velocity" => "the machine's top speed in mm/s, e.g. 300",
        "max_accel" => "the machine's acceleration in mm/s², e.g. 3000",
        "max_z_velocity" => "the top speed of Z in mm/s, e.g. 15",
        "max_z_accel" => "the acceleration of Z in mm/s², e.g. 100",
        "square_corner_velocity" => "the speed at a right-angled corner in mm/s, e.g. 5",
        "minimum_cruise_ratio" => "the share of a short move that must cruise, 0 to below 1, e.g. 0.5",
        "max_x_velocity" | "max_y_velocity" => "the top speed of that axis in mm/s, e.g. 250",
        "max_x_accel" | "max_y_accel" => "the acceleration of that axis in mm/s², e.g. 2000",
        "junction_deviation" => "the distance in mm by which a corner may be missed, e.g. 0.013",
        "max_jerk" => "the fastest change of the acceleration in mm/s³, e.g. 100000",
        "step_search" => "`usual`, or `ahead` for fewer bytes at more work of the host",
        "unreachable_speed" => "`clamp` to slow such moves down, or `reject` to refuse them",
        "pull_out_torque" | "slowing_torque" => {
            "the motor's torque in N·m at rates in full steps/s, e.g. 0: 2.2, 500: 2.0, 2000: 0.6"
        }
        "inertia" => "the inertia of rotor and load in g·cm², as the motor's shaft feels it, e.g. 480",
        "load_torque" => "the torque of friction at the motor's shaft in N·m, e.g. 0.1",
        "torque_margin" => "the share of the torque that may be asked for, above 0 to 1, e.g. 0.3",
        "resonances" => "the bands of full steps/s in which the motor shakes, e.g. 20-40, 90-110",
        "step_pin" | "dir_pin" => "the pin that the motor driver is wired to, e.g. gpio2 or !PA3",
        "enable_pin" => "the driver's enable pin, usually inverted, e.g. !gpio4",
        "endstop_pin" => "the switch's pin, e.g. ^gpio5 with a pull-up, ^!gpio5 where low means closed",
        "rotation_distance" => "the millimetres the axis moves in one turn of the motor, e.g. 40",
        "microsteps" => "the driver's microsteps, e.g. 16",
        "full_steps_per_rotation" => "200 for a 1.8° motor, 400 for a 0.9° motor",
        "gear_ratio" => "the teeth as driven:driving, e.g. 50:17, or 57:11, 2:1",
        "step_pulse_duration" => "the length of a step pulse in seconds, e.g. 0.000002",
        "position_endstop" => "the axis' position in mm where its endstop triggers, e.g. 0",
        "position_min" => "the lowest position in mm that the axis may go to, e.g. 0",
        "position_max" => "the highest position in mm that the axis may go to, e.g. 220",
        "homing_speed" | "second_homing_speed" | "homing_retract_speed" => "a homing speed in mm/s, e.g. 25",
        "homing_retract_dist" => "the millimetres to back off before the second approach, e.g. 5",
        "nozzle_diameter" => "the nozzle's bore in mm, e.g. 0.4",
        "filament_diameter" => "the filament's diameter in mm, 1.75 or 2.85",
        "max_extrude_cross_section" => "the thickest extrusion in mm², e.g. 0.64",
        "instantaneous_corner_velocity" => {
            "the extruder's sudden change of speed at a corner in mm/s, e.g. 1"
        }
        "max_extrude_only_distance" => "the longest push of filament without a move in mm, e.g. 50",
        "max_extrude_only_velocity" | "retract_speed" | "unretract_speed" => {
            "a filament speed in mm/s, e.g. 40"
        }
        "max_extrude_only_accel" => "an acceleration of filament in mm/s², e.g. 1500",
        "pressure_advance_model" => "`linear`, `tanh` or `recipr`",
        "linear_advance" => "an advance in seconds, e.g. 0.02",
        "nonlinear_offset" => "a length of filament in mm, e.g. 0.1",
        "linearization_velocity" => "a speed of the filament in mm/s, e.g. 2",
        "shaper_type" | "shaper_type_x" | "shaper_type_y" => {
            "`zv`, `mzv`, `zvd`, `ei`, `2hump_ei` or `3hump_ei`"
        }
        "shaper_freq_x" | "shaper_freq_y" => "the resonance's frequency in Hz, e.g. 50; 0 is off",
        "damping_ratio_x" | "damping_ratio_y" => "the resonance's damping ratio, e.g. 0.1",
        "pressure_advance" => "pressure advance in seconds, e.g. 0.045",
        "pressure_advance_smooth_time" => "a time in seconds, e.g. 0.040",
        "heater_pin" => "the heater's output pin, e.g. gpio17",
        "sensor_pin" => "the sensor's analog pin, e.g. gpio26",
        "sensor_type" => "the sensor's type, e.g. `EPCOS 100K B57560G104F` or `Generic 3950`",
        "pullup_resistor" => "the board's pull-up in ohms, usually 4700",
        "inline_resistor" => "a resistor in series with the sensor in ohms, usually 0",
        "control" => "`pid` or `watermark`",
        "pid_kp" | "pid_ki" | "pid_kd" => {
            "the gain that PID_CALIBRATE gave, e.g. pid_Kp 22.2, pid_Ki 1.08, pid_Kd 114"
        }
        "max_delta" => "the dead band of watermark control in °C, e.g. 2",
        "min_temp" => "the lowest reading of a sound sensor in °C, e.g. 0",
        "max_temp" => "the highest allowed temperature in °C, e.g. 260",
        "min_extrude_temp" => "the temperature in °C below which no filament is pushed, e.g. 170",
        "max_power" => "the largest share of full power, above 0 to 1, e.g. 1.0",
        "smooth_time" | "pwm_cycle_time" | "cycle_time" | "kick_start_time" => "a time in seconds, e.g. 0.1",
        "pin" => "the output pin, e.g. gpio19",
        "shutdown_speed" | "off_below" => "a share of full speed, 0 to 1",
        "max_error" => "the °C·s that a heater may lag behind, e.g. 120",
        "check_gain_time" => "the seconds in which a heater must gain heating_gain, e.g. 20",
        "hysteresis" | "heating_gain" => "a temperature difference in °C, e.g. 2",
        "timeout" => "the seconds without orders after which heaters and motors are switched off, e.g. 600",
        "xy_skew" | "xz_skew" | "yz_skew" => "how far one axis leans in the other in mm/mm, e.g. 0.002",
        "points" => "the heights in mm, a row of X for each Y on an indented line of its own",
        "min_x" | "max_x" | "min_y" | "max_y" => "where the mesh begins or ends in mm, e.g. 35",
        "x_count" | "y_count" => "the number of points along that axis, e.g. 5",
        "fade_start" | "fade_end" => "a height in mm, e.g. 1 and 10",
        "fade_target" => "what is added to Z above the fade in mm, e.g. 0",
        "split_delta_z" => "the largest error of Z along a move in mm, e.g. 0.025",
        "tension" | "bicubic_tension" => "the spline's tension, 0 to 2, e.g. 0.2",
        "retract_length" | "unretract_extra_length" => "a length of filament in mm, e.g. 0.8",
        "baud" => "the serial line's rate, e.g. 250000",
        "serial" => "the board's serial port",
        "beta" => "the sensor's Beta in kelvin, e.g. 3950",
        "temperature1" | "temperature2" | "temperature3" => {
            "a temperature in °C from the sensor's data sheet"
        }
        "resistance1" | "resistance2" | "resistance3" => "the resistance in ohms at that temperature",
        _ => "a value for it, or leave the line away",
    }
}

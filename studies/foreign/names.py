"""Column names: habits of public rover logs, of ROS, of data loggers, and of five languages."""

from __future__ import annotations

CORNERS = {
    "two letters": ("fl", "fr", "rl", "rr"),
    "side first": ("lf", "rf", "lr", "rr"),
    "capitals": ("FL", "FR", "BL", "BR"),
    "words": ("front_left", "front_right", "rear_left", "rear_right"),
    "words side first": ("left_front", "right_front", "left_rear", "right_rear"),
    "camels": ("FrontLeft", "FrontRight", "BackLeft", "BackRight"),
    "joints": ("hub_lf", "hub_rf", "hub_lb", "hub_rb"),
    "rows": ("1", "2", "3", "4"),
    "columns": ("1", "3", "2", "4"),
    "round": ("1", "2", "4", "3"),
    "quadrants": ("2", "1", "3", "4"),
    "from zero": ("0", "1", "2", "3"),
    "de": ("vl", "vr", "hl", "hr"),
    "de words": ("vorne_links", "vorne_rechts", "hinten_links", "hinten_rechts"),
    "fr": ("avg", "avd", "arg", "ard"),
    "fr words": ("avant_gauche", "avant_droite", "arriere_gauche", "arriere_droite"),
    "es": ("del_izq", "del_der", "tras_izq", "tras_der"),
    "es words": ("delantera_izquierda", "delantera_derecha", "trasera_izquierda", "trasera_derecha"),
    "it": ("ant_sx", "ant_dx", "post_sx", "post_dx"),
}
"""Style of naming -> names of the four wheels, in the order front left, front right, rear left, rear right."""
SIDES = {
    "en": ("left", "right"),
    "de": ("links", "rechts"),
    "fr": ("gauche", "droite"),
    "es": ("izq", "der"),
    "it": ("sx", "dx"),
}
LANGUAGES = {
    "en": {
        "corners": ("two letters", "side first", "capitals", "words", "words side first", "camels", "joints", "rows",
                    "columns", "round", "quadrants", "from zero"),
        "clock": ("time", "t", "timestamp", "Time", "stamp", "elapsed", "rosbagTimestamp", "%time"),
        "counter": ("frame", "seq", "sample", "idx", "Frame", "field.header.seq"),
        "place": ("x y z", "pos_x pos_y pos_z", "posX posY posZ", "px py pz", "mocap_x mocap_y mocap_z",
                  "pose.position.x pose.position.y pose.position.z", "Position X|Position Y|Position Z",
                  "vicon.x vicon.y vicon.z", "gt_x gt_y gt_z", "field.pose.position.x field.pose.position.y "
                  "field.pose.position.z", "tracker x|tracker y|tracker z"),
        "utm": ("easting northing altitude", "utm_e utm_n alt", "gps_easting gps_northing height"),
        "geo": ("latitude longitude altitude", "lat lon alt", "gps.lat gps.lng gps.alt", "fix.latitude fix.longitude "
                "fix.altitude"),
        "yaw": ("yaw", "heading", "theta", "psi", "rover_yaw", "pose.yaw", "mocap_yaw"),
        "pitch": ("pitch", "imu_pitch", "rover_pitch", "Pitch"),
        "roll": ("roll", "imu_roll", "rover_roll", "Roll"),
        "rate": ("wheel_speed_{}", "omega_{}", "wheel_vel_{}", "vel_{}", "{}_wheel_velocity", "w_{}", "motor_speed_{}",
                 "wheel_{}_rate", "enc_vel_{}", "joint_states.velocity[{}]"),
        "count": ("enc_{}", "ticks_{}", "encoder_{}", "{}_ticks"),
        "speed": ("v_{}", "{}_speed", "speed_{}", "wheel_speed_{}"),
        "current": ("current_{}", "motor_current_{}", "I_{}", "{}_current", "i_mot_{}"),
        "duty": ("duty_{}", "pwm_{}", "motor_pwm_{}"),
        "twist": ("odom_v odom_omega", "odom.twist.linear.x odom.twist.angular.z", "cmd_vel.linear.x "
                  "cmd_vel.angular.z"),
    },
    "de": {
        "corners": ("de", "de words", "two letters"),
        "clock": ("Zeit", "Zeitstempel", "t"),
        "counter": ("Bild", "Messung", "Nr"),
        "place": ("x y z", "Position X|Position Y|Position Z", "Pos X|Pos Y|Pos Z"),
        "utm": ("Rechtswert Hochwert Höhe",),
        "geo": ("Breitengrad Längengrad Höhe", "Breite Länge Höhe"),
        "yaw": ("Gierwinkel", "Kurs", "Gier"),
        "pitch": ("Nickwinkel", "Nick"),
        "roll": ("Rollwinkel", "Wankwinkel"),
        "rate": ("Drehzahl_{}", "Raddrehzahl_{}", "omega_{}", "Winkelgeschwindigkeit_{}"),
        "count": ("Encoder_{}", "Impulse_{}"),
        "speed": ("Geschwindigkeit_{}", "v_{}"),
        "current": ("Strom_{}", "Motorstrom_{}", "I_{}"),
        "duty": ("Tastgrad_{}", "PWM_{}"),
        "twist": ("Odometrie v|Odometrie omega",),
    },
    "fr": {
        "corners": ("fr", "fr words"),
        "clock": ("temps", "t", "horodatage"),
        "counter": ("trame", "numero"),
        "place": ("x y z", "position_x position_y position_z"),
        "utm": ("est_utm nord_utm altitude",),
        "geo": ("latitude longitude altitude",),
        "yaw": ("lacet", "cap"),
        "pitch": ("tangage",),
        "roll": ("roulis",),
        "rate": ("vitesse_roue_{}", "omega_{}"),
        "count": ("codeur_{}",),
        "speed": ("vitesse_{}",),
        "current": ("courant_{}", "courant_moteur_{}"),
        "duty": ("pwm_{}",),
        "twist": ("odom_v odom_omega",),
    },
    "es": {
        "corners": ("es", "es words"),
        "clock": ("tiempo", "t", "marca_de_tiempo"),
        "counter": ("cuadro", "muestra"),
        "place": ("x y z", "posicion_x posicion_y posicion_z"),
        "utm": ("este norte altura",),
        "geo": ("latitud longitud altitud",),
        "yaw": ("rumbo", "guiñada"),
        "pitch": ("cabeceo",),
        "roll": ("alabeo",),
        "rate": ("velocidad_rueda_{}", "vel_{}"),
        "count": ("encoder_{}",),
        "speed": ("velocidad_{}",),
        "current": ("corriente_{}", "corriente_motor_{}"),
        "duty": ("pwm_{}",),
        "twist": ("odom_v odom_omega",),
    },
    "it": {
        "corners": ("it",),
        "clock": ("tempo", "t"),
        "counter": ("campione",),
        "place": ("x y z", "posizione_x posizione_y posizione_z"),
        "utm": ("est nord quota",),
        "geo": ("latitudine longitudine quota",),
        "yaw": ("imbardata",),
        "pitch": ("beccheggio",),
        "roll": ("rollio",),
        "rate": ("velocita_ruota_{}", "omega_{}"),
        "count": ("encoder_{}",),
        "speed": ("velocita_{}",),
        "current": ("corrente_{}",),
        "duty": ("pwm_{}",),
        "twist": ("odom_v odom_omega",),
    },
}  # fmt: skip
"""Language -> kind of column -> names that are drawn at random. The names of one entry are separated by blanks, or by
bars if a name contains blanks. The braces {} are replaced by the name of a wheel or of a side."""


def parted(names: str) -> list[str]:
    """Return the column names that one entry of LANGUAGES contains, as a list."""
    return names.split("|") if "|" in names else names.split()

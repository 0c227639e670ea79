#!/bin/sh
# Builds the firmware's own C for this machine beside the programs here, which print the numbers of
# golden/firmware. Nothing of the firmware is kept in this repository.
# usage: build.sh FIRMWARE OUT    (FIRMWARE: a checkout of bitcraze/crazyflie-firmware, revision 2a18fc29)
set -eu
firmware=$1 out=$2 here=$(cd "$(dirname "$0")" && pwd)
mkdir -p "$out"
include="-I$here/stub $(find "$firmware"/src/modules/interface "$firmware"/src/utils/interface \
    "$firmware"/src/hal/interface "$firmware"/src/config "$firmware"/src/platform/interface \
    "$firmware"/src/deck -type d | sed 's/^/-I/' | tr '\n' ' ')"
modules=$firmware/src/modules/src utils=$firmware/src/utils/src
objects=
for source in "$modules"/kalman_core/kalman_core.c "$modules"/kalman_core/mm_sweep_angles.c \
    "$modules"/kalman_core/mm_yaw_error.c "$modules"/kalman_core/mm_tof.c \
    "$modules"/kalman_core/mm_tdoa.c "$modules"/kalman_core/mm_distance.c \
    "$modules"/kalman_core/mm_position.c "$modules"/outlierfilter/outlierFilterLighthouse.c \
    "$modules"/outlierfilter/outlierFilterTdoa.c "$modules"/lighthouse/lighthouse_position_est.c \
    "$utils"/lighthouse/lighthouse_geometry.c "$utils"/lighthouse/lighthouse_calibration.c \
    "$modules"/planner.c "$modules"/pptraj.c "$modules"/pptraj_compressed.c "$modules"/axis3fSubSampler.c "$modules"/controller/attitude_pid_controller.c \
    "$modules"/controller/controller_pid.c "$modules"/controller/position_controller_pid.c \
    "$modules"/controller/controller_lee.c "$modules"/power_distribution_quadrotor.c "$utils"/pid.c "$utils"/filter.c "$utils"/num.c; do
    object=$out/$(basename "$source" .c).o
    gcc -w -O1 -std=gnu11 -D__fp16=uint16_t $include -c "$source" -o "$object"
    objects="$objects $object"
done
rm -f "$out/libfirmware.a"
ar rcs "$out/libfirmware.a" $objects
# What is taken out of two drivers, whose other parts need the hardware.
drivers=$firmware/src/deck/drivers/src
{
    sed -n '/^#ifndef LEDRING_TIME_MEM_SIZE/,/^static ledtimings/p; /define COPY_COLOR/p' "$drivers/ledring12.c"
    sed -n '/define RGB565_TO_RGB888/,/^$/p; /define LEDRING_TIME_MEM_SEC/p' "$drivers/ledring12.c"
    sed -n '/^static bool isTimeMemDone/,/^static void timeMemEffect/p' "$drivers/ledring12.c"
    sed -n '/^static void timeMemEffect/,/^}/p' "$drivers/ledring12.c" | tail -n +2
} > "$out/ring.inc"
{
    sed -n '/^static const uint8_t gamma8/,/^}/p' "$drivers/color_led_deck.c"
    sed -n '/^static inline uint8_t applyGamma/,/^static bool checkProtocol/p' "$drivers/color_led_deck.c" |
        sed '$d'
} > "$out/color_led.inc"
sed -n '/^float motorsCompensateBatteryVoltage/,/^}/p' "$firmware/src/drivers/src/motors.c" > "$out/motors.inc"
link() {
    gcc -w -O1 -std=gnu11 -D__fp16=uint16_t $include -I"$modules" -I"$out" "$@" -L"$out" -lfirmware -lm
}
for program in "$here"/*.c; do
    link "$program" -o "$out/$(basename "$program" .c)"
done
# Two drones: their propellers, thrust over voltage, arm and idle thrust.
link -DCONFIG_ENABLE_THRUST_BAT_COMPENSATED -DCONFIG_CRAZYFLIE_LEGACY_PROPELLERS "$here/lee.c" -o "$out/lee"
link -DCONFIG_ENABLE_THRUST_BAT_COMPENSATED -DCONFIG_PLATFORM_CF21BL -DCONFIG_MOTORS_REQUIRE_ARMING=1 \
    -DCONFIG_MOTORS_DEFAULT_IDLE_THRUST=7000 "$here/lee.c" -o "$out/lee_brushless"

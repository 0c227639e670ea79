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
    "$modules"/axis3fSubSampler.c "$modules"/controller/attitude_pid_controller.c \
    "$modules"/controller/controller_pid.c "$modules"/controller/position_controller_pid.c \
    "$modules"/power_distribution_quadrotor.c "$utils"/pid.c "$utils"/filter.c "$utils"/num.c; do
    object=$out/$(basename "$source" .c).o
    gcc -w -O1 -std=gnu11 -D__fp16=uint16_t $include -c "$source" -o "$object"
    objects="$objects $object"
done
for program in "$here"/*.c; do
    gcc -w -O1 -std=gnu11 -D__fp16=uint16_t -DFIRMWARE="\"$firmware\"" $include "$program" $objects \
        -o "$out/$(basename "$program" .c)" -lm
done

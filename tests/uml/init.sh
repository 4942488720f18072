#!/bin/sh
# Process 1 of User-Mode Linux: brings up vcan0, runs the command in UML_CMD, prints UML-RC=<its exit code>, halts.
export PATH=/usr/sbin:/usr/bin:/sbin:/bin PYTHONDONTWRITEBYTECODE=1 TMPDIR=/run
mount -t proc proc /proc; mount -t sysfs sys /sys; mount -t tmpfs tmpfs /run
exec >/dev/console 2>&1
echo UML-UP
modules=/usr/lib/uml/modules/$(uname -r)/kernel
# In the order of their dependencies: vcan fails with "Unknown symbol" where can-dev is missing.
for module in net/can/can net/can/can-raw net/can/can-bcm drivers/net/can/dev/can-dev drivers/net/can/vcan; do
  insmod "$modules/$module.ko" || echo "UML-FAIL insmod $module"
done
ip link set lo up
for bus in vcan0 vcan1; do
  ip link add dev $bus type vcan && ip link set $bus up || echo "UML-FAIL $bus"
done
"$UML_CMD" </dev/null
echo "UML-RC=$?"
echo o > /proc/sysrq-trigger
sleep 2

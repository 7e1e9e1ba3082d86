#include <linux/can/dev.h>
#include <linux/module.h>
#include <linux/rtnetlink.h>

/* Takes can0 bus-off as its driver does when the controller says so: the error frame, then the kernel's own bus-off. For
 * tests/vm/run, since QEMU's controllers never say so. */
static int __init bus_off_init(void) {
  struct net_device* can;
  struct can_frame* frame;
  struct sk_buff* buffer = NULL;

  rtnl_lock();
  can = __dev_get_by_name(&init_net, "can0");
  if (can != NULL) {
    local_bh_disable();
    buffer = alloc_can_err_skb(can, &frame);
    if (buffer != NULL) {
      can_change_state(can, frame, CAN_STATE_BUS_OFF, CAN_STATE_BUS_OFF);
      can_bus_off(can);
      netif_rx(buffer);
    }
    local_bh_enable();
  }
  rtnl_unlock();
  return buffer != NULL ? 0 : -ENODEV;
}
module_init(bus_off_init);

static void __exit bus_off_exit(void) {}
module_exit(bus_off_exit);
MODULE_LICENSE("Dual MIT/GPL");

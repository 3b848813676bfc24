// Reads rows of states, steps the controller at twice its rate, and prints the duties of each period.
#include <cstdio>
#include "slip_controller.cpp"

int main() {
  auto *controller = made();
  const auto states = controller->state_interface_configuration().names, commands = controller->command_interface_configuration().names;
  std::vector<double> read(states.size()), duty(commands.size());
  for (auto &value : read) controller->state_interfaces_.push_back({&value});
  for (auto &value : duty) controller->command_interfaces_.push_back({&value});
  for (const auto &name : states) std::printf("%s ", name.c_str());
  for (const auto &name : commands) std::printf("%s ", name.c_str());
  std::printf("\n");
  controller->on_init();
  controller->on_activate({});
  for (int k = 0;; ++k) {
    if (k % 2 == 0)
      for (auto &value : read)
        if (std::scanf("%lf", &value) != 1) return 0;
    controller->update({}, {0.5 * ROVER_PERIOD});
    if (k % 2 == 0) {
      for (double value : duty) std::printf("%.17g ", value);
      std::printf("\n");
    }
  }
}

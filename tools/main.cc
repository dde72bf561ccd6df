#include "platform/assemble.h"
#include "tools/command/command_line.h"

int main(int argc, char** argv) {
  haustra::PrepareVisionDevices();
  return haustra::RunCommandLine(argc, argv);
}

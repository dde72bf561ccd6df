#include "tools/command/command_line.h"

int main(int argc, char** argv) { return haustra::RunCommandLine(argc, argv); }

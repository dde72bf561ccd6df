#include "tools/manual/completion.h"

#include <set>

#include "tools/manual/manual_page.h"

namespace haustra::manual {
namespace {

// The options of a command and of those below it, each once.
std::vector<OptionText> AllOptions(const CLI::App& command) {
  std::vector<OptionText> options;
  std::set<std::string> seen;
  const auto add = [&](const CLI::App& app) {
    for (OptionText& option : OptionsOf(app)) {
      if (!option.is_positional && seen.insert(option.names).second) options.push_back(std::move(option));
    }
  };
  add(command);
  for (const CLI::App* below : CommandsOf(command)) add(*below);
  return options;
}

std::string LongName(const OptionText& option) { return option.names.substr(option.names.find("--")); }

std::string Words(const std::vector<std::string>& words, const char* end = "") {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : " ") + word + end;
  return text;
}

// Inside single quotes, and inside the brackets of zsh.
std::string ZshText(const std::string& text) {
  std::string escaped;
  for (const char c : text) {
    if (c == '\'') {
      escaped += "'\\''";
    } else if (c == '\n') {
      escaped += ' ';
    } else {
      if (c == '[' || c == ']' || c == ':' || c == '\\') escaped += '\\';
      escaped += c;
    }
  }
  return escaped;
}

}  // namespace

std::string BashCompletion(const CLI::App& app, const std::vector<std::string>& keys) {
  std::vector<std::string> commands;
  for (const CLI::App* command : CommandsOf(app)) commands.push_back(command->get_name());
  std::string values, options;
  for (const CLI::App* command : CommandsOf(app)) {
    std::vector<std::string> names, below;
    for (const OptionText& option : AllOptions(*command)) {
      names.push_back(LongName(option));
      if (!option.choices.empty()) {
        values +=
            "    '" + command->get_name() + " " + LongName(option) + "') words='" + Words(option.choices) + "' ;;\n";
      } else if (!option.value.empty() && option.names != "--set") {
        values += "    '" + command->get_name() + " " + LongName(option) + "') return ;;\n";
      }
    }
    for (const CLI::App* each : CommandsOf(*command)) below.push_back(each->get_name());
    options += "    " + command->get_name() + ") options='" + Words(names) + "' below='" + Words(below) + "' ;;\n";
  }
  return "# bash completion for haustra; made from the program's own tables.\n"
         "_haustra() {\n"
         "  local word=\"${COMP_WORDS[COMP_CWORD]}\" before=\"${COMP_WORDS[COMP_CWORD - 1]}\"\n"
         "  local command='' options='--help --version' below='' words='' i\n"
         "  COMPREPLY=()\n"
         "  for ((i = 1; i < COMP_CWORD; ++i)); do\n"
         "    if [[ ${COMP_WORDS[i]} != -* ]]; then command=\"${COMP_WORDS[i]}\"; break; fi\n"
         "  done\n"
         "  case \"$command $before\" in\n" +
         values + "    *' --set') words='" + Words(keys, "=") +
         "'; compopt -o nospace 2> /dev/null ;;\n"
         "  esac\n"
         "  if [[ -n $words ]]; then COMPREPLY=($(compgen -W \"$words\" -- \"$word\")); return; fi\n"
         "  case \"$command\" in\n"
         "    '') below='" +
         Words(commands) + "' ;;\n" + options +
         "  esac\n"
         "  if [[ $word == -* ]]; then words=\"$options\"; else words=\"$below\"; fi\n"
         "  COMPREPLY=($(compgen -W \"$words\" -- \"$word\"))\n"
         "}\n"
         "complete -o bashdefault -o default -F _haustra haustra\n";
}

std::string ZshCompletion(const CLI::App& app, const std::vector<std::string>& keys) {
  std::string commands, options;
  for (const CLI::App* command : CommandsOf(app)) {
    commands += "    '" + command->get_name() + ":" + ZshText(command->get_description()) + "'\n";
    options += "    " + command->get_name() + ")\n      _arguments";
    for (const OptionText& option : AllOptions(*command)) {
      const std::string name = LongName(option);
      options += " \\\n        '*" + name + "[" + ZshText(option.description) + "]";
      if (!option.choices.empty()) {
        options += ":value:(" + Words(option.choices) + ")";
      } else if (name == "--set") {
        options += ":key: compadd -S \"\" -a keys";
      } else if (!option.value.empty()) {
        options += ":value:_files";
      }
      options += "'";
    }
    std::vector<std::string> below;
    for (const CLI::App* each : CommandsOf(*command)) below.push_back(each->get_name());
    if (!below.empty()) options += " \\\n        '1:command:(" + Words(below) + ")'";
    options += " \\\n        '*:file:_files'\n      ;;\n";
  }
  return "#compdef haustra\n"
         "# zsh completion for haustra; made from the program's own tables.\n"
         "_haustra() {\n"
         "  local -a commands keys\n"
         "  keys=(" +
         Words(keys, "=") +
         ")\n"
         "  commands=(\n" +
         commands +
         "  )\n"
         "  if (( CURRENT == 2 )); then\n"
         "    _describe command commands\n"
         "    _arguments '--help[Print the help]' '--version[Print the version]'\n"
         "    return\n"
         "  fi\n"
         "  local command=$words[2]\n"
         "  shift words\n"
         "  (( CURRENT-- ))\n"
         "  case $command in\n" +
         options +
         "  esac\n"
         "}\n"
         "_haustra \"$@\"\n";
}

}  // namespace haustra::manual

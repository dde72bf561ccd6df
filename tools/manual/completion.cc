#include "tools/manual/completion.h"

#include <functional>

#include "tools/manual/manual_page.h"

namespace haustra::manual {
namespace {

std::string LongName(const OptionText& option) { return option.names.substr(option.names.find("--")); }

std::string Words(const std::vector<std::string>& words, const char* end = "") {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : " ") + word + end;
  return text;
}

// A program and all commands below it, each before those below it.
void ForEach(const CLI::App& app, const std::function<void(const CLI::App&)>& visit) {
  visit(app);
  for (const CLI::App* below : CommandsOf(app)) ForEach(*below, visit);
}

bool TakesKey(const OptionText& option) { return option.names == "--set"; }

// What may stand for a value, in the tables of bash: words, or '/' for names of files, or '=' for the keys.
std::string BashValue(const OptionText& option) {
  if (TakesKey(option)) return "=";
  return option.is_path ? "/" : Words(option.choices);
}

std::string BashEntry(const std::string& key, const std::string& value) {
  return "    ['" + key + "']='" + value + "'\n";
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

// A value as _arguments takes it. What its user goes on with is followed by no space.
std::string ZshValue(const std::string& name, const OptionText& option) {
  const std::string words = Words(option.choices);
  std::string offered = words.empty() ? " " : "(" + words + ")";
  if (words.find('@') != std::string::npos) offered = " compadd -S \"\" -- " + words;
  if (option.is_path) offered = "_files";
  if (TakesKey(option)) offered = " compadd -S \"\" -a keys";
  return ":" + ZshText(name) + ":" + offered;
}

// `first`: what the function does first.
std::string ZshFunction(const CLI::App& app, const std::string& first) {
  const std::vector<const CLI::App*> below = CommandsOf(app);
  std::string commands, arguments;
  for (const CLI::App* each : below) {
    commands += "    '" + each->get_name() + ":" + ZshText(each->get_description()) + "'\n";
  }
  int place = 0;
  for (const OptionText& option : OptionsOf(app)) {
    arguments += " \\\n    '";
    if (option.is_positional) {
      arguments += (option.takes_many ? "*" : std::to_string(++place)) + ZshValue(option.names, option);
    } else {
      arguments += "*" + LongName(option) + "[" + ZshText(option.description) + "]";
      if (!option.value.empty()) arguments += ZshValue("value", option);
    }
    arguments += "'";
  }
  const std::string name = "_" + NameOf(app, '_'), begin = name + "() {\n" + first;
  if (below.empty()) return begin + "  _arguments" + arguments + "\n}\n";
  return begin +
         "  local curcontext=\"$curcontext\" state line\n"
         "  local -A opt_args\n"
         "  local -a commands\n"
         "  commands=(\n" +
         commands + "  )\n  _arguments -C" + arguments +
         " \\\n    '1: :->command' '*:: :->rest'\n"
         "  case $state in\n"
         "    command) _describe command commands ;;\n"
         "    rest) (( $+functions[" +
         name + "_$words[1]] )) && " + name +
         "_$words[1] ;;\n"
         "  esac\n"
         "}\n";
}

}  // namespace

std::string BashCompletion(const CLI::App& app, const std::vector<std::string>& keys) {
  const std::string program = app.get_name();
  std::string below, options, values;
  ForEach(app, [&](const CLI::App& command) {
    const std::string name = NameOf(command, ' ');
    std::vector<std::string> commands, names;
    for (const CLI::App* each : CommandsOf(command)) commands.push_back(each->get_name());
    int place = 0;
    for (const OptionText& option : OptionsOf(command)) {
      if (option.is_positional) {
        values += BashEntry(name + (option.takes_many ? " *" : " " + std::to_string(++place)), BashValue(option));
        continue;
      }
      names.push_back(LongName(option));
      if (!option.value.empty()) values += BashEntry(name + " " + LongName(option), BashValue(option));
    }
    options += BashEntry(name, Words(names));
    if (!commands.empty()) below += BashEntry(name, Words(commands));
  });
  return "# bash completion for " + program + "; made from the program's own tables.\n_" + program +
         "() {\n"
         "  local -A below=(\n" +
         below +
         "  )\n"
         "  local -A options=(\n" +
         options +
         "  )\n"
         "  # Of an option, and of the words of a command by their place; '/': a file, '=': a key.\n"
         "  local -A values=(\n" +
         values + "  )\n  local keys='" + Words(keys, "=") + "'\n  local command='" + program +
         "' option='' offered='' place=1 each i\n"
         "  local word=\"${COMP_WORDS[COMP_CWORD]}\" before=\"${COMP_WORDS[COMP_CWORD - 1]}\"\n"
         "  COMPREPLY=()\n"
         "  for ((i = 1; i < COMP_CWORD; ++i)); do\n"
         "    each=\"${COMP_WORDS[i]}\"\n"
         "    # v4l2:/dev/video0 and redout@5 are one word that bash takes apart.\n"
         "    if [[ $each == [:@] || ${COMP_WORDS[i - 1]} == [:@] ]]; then continue; fi\n"
         "    if [[ $each == '=' ]]; then option=\"${option:-=}\"  # bash takes --option=value and key=value apart\n"
         "    elif [[ -n $option ]]; then option=''\n"
         "    elif [[ $each == -* ]]; then [[ -z ${values[\"$command $each\"]+x} ]] || option=\"$each\"\n"
         "    elif [[ -n ${options[\"$command $each\"]+x} ]]; then command+=\" $each\"\n"
         "    else ((++place)); fi\n"
         "  done\n"
         "  if [[ $word == '=' ]]; then word='' option=\"${option:-=}\"; fi\n"
         "  if [[ $word == [:@] ]]; then before=\"$word\"; fi\n"
         "  # A source goes on with its file, a key with what may be one, an event with its time.\n"
         "  if [[ $before == ':' || $option == '=' ]]; then offered='/'\n"
         "  elif [[ $before == '@' ]]; then return\n"
         "  elif [[ -n $option ]]; then offered=\"${values[\"$command $option\"]}\"\n"
         "  elif [[ $word == -* ]]; then offered=\"${options[$command]}\"\n"
         "  else offered=\"${below[$command]:-${values[\"$command $place\"]-${values[\"$command *\"]}}}\"; fi\n"
         "  if [[ $offered == '/' ]]; then compopt -o default; return; fi\n"
         "  if [[ $offered == '=' ]]; then offered=\"$keys\"; fi\n"
         "  COMPREPLY=($(compgen -W \"$offered\" -- \"$word\"))\n"
         "  # A key goes on with its value, an event with its time.\n"
         "  if [[ ${COMPREPLY[0]} == *[=@] ]]; then compopt -o nospace; fi\n"
         "}\n"
         "complete -F _" +
         program + " " + program + "\n";
}

std::string ZshCompletion(const CLI::App& app, const std::vector<std::string>& keys) {
  const std::string program = app.get_name();
  // Functions that this one calls see them.
  const std::string locals = "  local -a keys\n  keys=(" + Words(keys, "=") + ")\n";
  std::string functions;
  ForEach(app, [&](const CLI::App& command) { functions += ZshFunction(command, &command == &app ? locals : ""); });
  return "#compdef " + program + "\n# zsh completion for " + program + "; made from the program's own tables.\n" +
         functions + "_" + program + " \"$@\"\n";
}

}  // namespace haustra::manual

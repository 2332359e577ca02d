"use strict";
const { workspace } = require("vscode");
const { LanguageClient } = require("vscode-languageclient/node");

let client;

exports.activate = () => {
  const command = workspace.getConfiguration("avow").get("command");
  client = new LanguageClient("avow", "Avow", { command, args: ["lsp"] }, { documentSelector: [{ language: "rcl" }] });
  return client.start();
};

exports.deactivate = () => client && client.stop();

"use strict";
const { window, workspace } = require("vscode");

let client;

/** Starts `avow lsp`. Without the client's library (a package built where npm was not there) contracts have their colours only. */
exports.activate = async () => {
  let library;
  try {
    library = require("vscode-languageclient/node");
  } catch {
    window.showWarningMessage("This package was built without vscode-languageclient: contracts have their colours only.");
    return;
  }
  const command = workspace.getConfiguration("avow").get("command");
  const documentSelector = [{ language: "rcl" }, { language: "yaml", pattern: "**/contracts/**/plan.yaml" }];
  try {
    client = new library.LanguageClient("avow", "Avow", { command, args: ["lsp"] }, { documentSelector });
    await client.start();
  } catch (error) {
    window.showErrorMessage(`${command} lsp could not be started (${error.message}): pip install 'avow[lsp]', or say in avow.command where it is.`);
  }
};

exports.deactivate = () => client && client.stop();

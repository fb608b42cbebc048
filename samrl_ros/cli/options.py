"""A command's options follow from a dataclass: one option per field, its default the field's own.

A field whose annotation carries `typer.Option` or `typer.Argument` becomes that option or argument:

    states: Annotated[int, typer.Option(help="Labelled states.", min=100)] = TrainSettings.states

Fields without one are not on the command line and keep their defaults. `tuple[T, ...]` is an option that may
be repeated. A path called `out` is looked at before the command works: minutes of work may go there. The
dataclass and what it imports are loaded when the command is used, so that `samrl --help` stays quick.
"""

from __future__ import annotations

import dataclasses
import importlib
import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, get_args, get_origin, get_type_hints

import typer
from typer.core import TyperCommand, TyperGroup
from typer.models import ParameterInfo

from samrl_core.common.files import check_folder


def add_command(app: typer.Typer, name: str, target: str, help: str) -> None:
    """Add a command that is loaded when it is used.

    Args:
        app: gets the command.
        name: of the command.
        target: `module:function`. The function's first parameter is annotated with a dataclass of options,
            further ones are typer's own, such as `typer.Context`; it returns the exit code.
        help: what the command does, in one line.
    """

    class LazyCommand(TyperCommand):
        def get_params(self, ctx: Any) -> list[Any]:
            if not self.params:
                command = _loaded_command(target)
                self.params, self.callback = command.params, command.callback
            return super().get_params(ctx)

    app.command(name, cls=LazyCommand, help=help)(lambda: None)


def add_group(app: typer.Typer, name: str, target: str, help: str) -> None:
    """Add a group of commands that is loaded when it is used.

    Args:
        app: gets the group.
        name: of the group.
        target: `module:app` of the group's own typer app.
        help: what the group is for, in one line.
    """

    class LazyGroup(TyperGroup):
        def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
            if not self.commands:
                module, _, attribute = target.partition(":")
                group = typer.main.get_group(getattr(importlib.import_module(module), attribute))
                self.commands, self.params, self.callback = group.commands, group.params, group.callback
                self.no_args_is_help = group.no_args_is_help
                self.invoke_without_command = group.invoke_without_command
            return super().parse_args(ctx, args)

    app.add_typer(typer.Typer(cls=LazyGroup, help=help), name=name)


def command_function(function: Callable[..., int]) -> Callable[..., None]:
    """A typer callback from a function of a dataclass of options, see `add_command`."""
    options_name, *others = inspect.signature(function).parameters.values()
    hints = get_type_hints(function, include_extras=True)
    settings = hints[options_name.name]
    repeated: set[str] = set()
    parameters = [one.replace(annotation=hints[one.name], kind=one.KEYWORD_ONLY) for one in others]
    types = get_type_hints(settings, include_extras=True)
    for field in dataclasses.fields(settings):
        annotation = types[field.name]
        if not any(isinstance(one, ParameterInfo) for one in getattr(annotation, "__metadata__", ())):
            continue
        default: Any = field.default
        if field.default_factory is not dataclasses.MISSING:
            default = field.default_factory()
        elif default is dataclasses.MISSING:
            default = inspect.Parameter.empty
        plain, *extras = get_args(annotation)
        if get_origin(plain) is tuple and get_args(plain)[1:] == (...,):
            repeated.add(field.name)
            optional = list[get_args(plain)[0]] | None  # ty: ignore[invalid-type-form]
            annotation = Annotated[(optional, *extras)]  # ty: ignore[invalid-type-form]
            default = inspect.Parameter.empty if default is inspect.Parameter.empty else list(default) or None
        parameters.append(
            inspect.Parameter(
                field.name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=annotation
            )
        )

    def run(**given: Any) -> None:
        rest = {one.name: given.pop(one.name) for one in others}
        values = {name: tuple(value or ()) if name in repeated else value for name, value in given.items()}
        if isinstance(out := values.get("out"), Path):
            check_folder(out)
        raise typer.Exit(function(settings(**values), **rest))

    run.__signature__ = inspect.Signature(parameters)  # ty: ignore[missing-attribute]
    run.__annotations__ = {one.name: one.annotation for one in parameters}
    return run


def _loaded_command(target: str) -> Any:
    module, _, name = target.partition(":")
    app = typer.Typer(add_completion=False)
    app.command()(command_function(getattr(importlib.import_module(module), name)))
    return typer.main.get_command(app)

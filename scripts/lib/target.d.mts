export declare const root: string;
export declare function targetFolder(): string;
export declare function stepcast(): string;
